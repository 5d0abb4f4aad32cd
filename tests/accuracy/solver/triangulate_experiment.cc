// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/triangulate_experiment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <string>
#include <utility>

#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "common/triangulate/triangulate_rows.h"
#include "server/solve/calibrate.h"
#include "server/solve/evaluate/triangulation_accuracy.h"
#include "tests/accuracy/rig/calibration_errors.h"

namespace rigcal::accuracy {
namespace {

constexpr double kSolvedShare = 0.75;  // of the wave; the rest is triangulated
constexpr size_t kPointsPerTrial = 1500;
// Of each span of the wand, drawn and stated: its scale is right to about 0.04 %.
constexpr double kSpanSigmaM = 0.0001;

// A triangulated point and where it was, in the frame of the reference camera.
struct PointWithTruth {
  TriangulatedPoint point;
  Eigen::Vector3d in_world_m, in_reference_m;
};

server::CalibrationInput FirstPart(const SimulatedWorld& world, double until_s,
                                   std::vector<CameraRows>* rest) {
  server::CalibrationInput input;
  input.target = world.target();
  for (int c = 0; c < static_cast<int>(world.cameras().size()); ++c) {
    server::CameraTrack& track = input.tracks.emplace_back();
    track.session_id = "s";
    track.camera = world.cameras()[static_cast<size_t>(c)].description;
    CameraRows& rows = rest->emplace_back();
    rows.camera = track.camera.camera;
    for (int i = 0; i < world.FrameCount(c); ++i) {
      const bool first = world.FrameRigTime(c, i) < until_s;
      (first ? track.observations : rows.rows).push_back(world.Observe(c, i));
    }
  }
  return input;
}

// Of a coordinate in a range, 0 to kVoxelsPerSide - 1.
int CellOf(double value, double low, double high) {
  const int cell = static_cast<int>(kVoxelsPerSide * (value - low) / (high - low));
  return std::clamp(cell, 0, kVoxelsPerSide - 1);
}

absl::Status MeasureVoxels(const SimulatedWorld& world, TriangulateTrial* trial) {
  const double until_s = kSolvedShare * world.options().duration_s;
  std::vector<CameraRows> rest;
  const server::CalibrationOutcome outcome =
      server::Calibrate(FirstPart(world, until_s, &rest), {});
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  const CalibrationResult& calibration = *outcome.result;
  TriangulationOptions options;
  options.sigma_px = world.options().noise_px;
  RIGCAL_ASSIGN_OR_RETURN(const Triangulation triangulation,
                          TriangulateRows(calibration, std::move(rest), options));

  const int reference = CameraIndex(world, calibration.reference_camera);
  const RigidTransform& reference_from_world =
      world.cameras()[static_cast<size_t>(reference)].cam_from_rig;
  // Offsets are against the median clock, which need not be the world's.
  std::vector<double> shifts_s;
  for (const CalibratedCamera& camera : calibration.cameras) {
    const SimulatedCamera& truth =
        world.cameras()[static_cast<size_t>(CameraIndex(world, camera.camera))];
    const double origin_s = 1e-9 * static_cast<double>(truth.clock_origin_ns);
    shifts_s.push_back(camera.time_offset_s -
                       (truth.time_offset_s - origin_s +
                        1e-6 * truth.time_rate_ppm * (camera.time_epoch_s - origin_s)));
  }
  const double shift_s = Median(shifts_s);
  std::vector<PointWithTruth> points;
  const size_t stride = triangulation.points.size() / kPointsPerTrial + 1;
  Eigen::Array3d low = Eigen::Array3d::Constant(1e9), high = -low;
  for (size_t i = 0; i < triangulation.points.size(); i += stride) {
    const TriangulatedPoint& point = triangulation.points[i];
    const double time_s = 1e-9 * static_cast<double>(point.rig_time_ns) - shift_s;
    PointWithTruth with{point, {}, {}};
    with.in_world_m = world.MarkerAt(world.WandAt(time_s), static_cast<size_t>(point.marker));
    with.in_reference_m = reference_from_world * with.in_world_m;
    low = low.min(with.in_world_m.array());
    high = high.max(with.in_world_m.array());
    points.push_back(std::move(with));
  }

  server::AccuracyOptions accuracy_options;
  accuracy_options.sigma_px = options.sigma_px;
  for (const PointWithTruth& with : points) {
    accuracy_options.points_m.push_back(with.point.position_m);
  }
  RIGCAL_ASSIGN_OR_RETURN(const server::Accuracy accuracy,
                          server::ComputeAccuracy(calibration, accuracy_options));
  trial->voxels.resize(kVoxelsPerSide * kVoxelsPerSide * kVoxelsPerSide);
  for (size_t i = 0; i < points.size(); ++i) {
    const server::PointAccuracy& predicted = accuracy.points[i];
    if (predicted.camera_count < 2) continue;
    const PointWithTruth& with = points[i];
    size_t cell = 0;
    for (int axis = 0; axis < 3; ++axis) {
      cell = kVoxelsPerSide * cell +
             static_cast<size_t>(CellOf(with.in_world_m[axis], low[axis], high[axis]));
    }
    const Eigen::Vector3d error = with.point.position_m - with.in_reference_m;
    trial->voxels[cell].Add({error.squaredNorm(), predicted.sigma_m.squaredNorm(),
                             with.point.covariance_m2.trace(),
                             error.dot(with.point.covariance_m2.ldlt().solve(error)), 1});
  }
  return absl::OkStatus();
}

}  // namespace

void VoxelErrors::Add(const VoxelErrors& other) {
  squared_m2 += other.squared_m2;
  predicted_m2 += other.predicted_m2;
  stated_m2 += other.stated_m2;
  nees += other.nees;
  count += other.count;
}

TriangulateTrial RunTriangulateTrial(const SimulationOptions& simulation) {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  target.span_tolerance_m = kSpanSigmaM;
  SimulationOptions options = simulation;
  options.length_sigma_m = kSpanSigmaM;
  TriangulateTrial trial;
  const absl::StatusOr<SimulatedWorld> world = SimulatedWorld::Create(options, target);
  trial.status = world.ok() ? MeasureVoxels(*world, &trial) : world.status();
  return trial;
}

VoxelErrors SumOf(const std::vector<VoxelErrors>& voxels) {
  VoxelErrors sum;
  for (const VoxelErrors& voxel : voxels) sum.Add(voxel);
  return sum;
}

}  // namespace rigcal::accuracy
