// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/origin_experiment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "common/origin/frame_fit.h"
#include "common/origin/origin.h"
#include "common/origin/still_points.h"
#include "common/status/status_macros.h"
#include "common/triangulate/point_fit.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/rig/calibration_errors.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::accuracy {
namespace {

constexpr int kFramesPerPlace = 25;  // 1 s; more count no more (kMaxRowsOfStillCentre)
constexpr double kHalfFloorM = 2;
constexpr double kFloorStepM = 0.5;
constexpr double kDegPerRad = 180 / std::numbers::pi;

// Places around the middle of the floor, each turned another way; a marker's centre is on z = 0.
std::vector<WandPose> FloorPlaces(uint32_t seed, int count, double length_m) {
  std::mt19937_64 random(1000 + seed);
  std::uniform_real_distribution<double> share(0, 1);
  std::vector<WandPose> places;
  const double turn = 2 * std::numbers::pi * share(random);
  for (int i = 0; i < count; ++i) {
    const double angle = turn + 2 * std::numbers::pi * (i + 0.2 * share(random)) / count;
    const double along = angle + std::numbers::pi * (0.3 + 0.4 * share(random));
    const Eigen::Vector3d direction(std::cos(along), std::sin(along), 0);
    const Eigen::Vector3d middle(1.2 * std::cos(angle), 1.2 * std::sin(angle), 0);
    places.push_back({middle - 0.5 * length_m * direction, direction});
  }
  return places;
}

std::vector<CameraRows> FloorRows(const SimulatedWorld& world,
                                  const std::vector<WandPose>& places) {
  std::vector<CameraRows> rows;
  for (int c = 0; c < static_cast<int>(world.cameras().size()); ++c) {
    CameraRows& camera = rows.emplace_back();
    camera.camera = world.cameras()[static_cast<size_t>(c)].description.camera;
    // Frames after those of the wave, whose noise is another.
    int frame = world.FrameCount(c);
    for (const WandPose& place : places) {
      for (int i = 0; i < kFramesPerPlace; ++i) {
        camera.rows.push_back(world.ObserveWand(c, frame++, place));
      }
    }
  }
  return rows;
}

// Where points of the true floor come to lie, as the calibration triangulates them.
void MeasureFloor(const SimulatedWorld& world, const CalibrationResult& moved, OriginTrial* trial) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (double x = -kHalfFloorM; x <= kHalfFloorM; x += kFloorStepM) {
    for (double y = -kHalfFloorM; y <= kHalfFloorM; y += kFloorStepM) {
      std::vector<PixelView> views;
      for (size_t c = 0; c < moved.cameras.size(); ++c) {
        const SimulatedCamera& truth =
            world.cameras()[static_cast<size_t>(CameraIndex(world, moved.cameras[c].camera))];
        PixelView view{static_cast<int>(c), {}, Eigen::Matrix2d::Identity()};
        const ImageSize& size = truth.description.image_size_px;
        if (!ImageOf(truth.true_intrinsics, truth.cam_from_rig * Eigen::Vector3d(x, y, 0),
                     &view.centre_px) ||
            view.centre_px.minCoeff() < 0 || view.centre_px.x() > size.width - 1.0 ||
            view.centre_px.y() > size.height - 1.0) {
          continue;
        }
        views.push_back(view);
      }
      const auto point = FitPoint(moved.cameras, views);
      if (!point) continue;
      const double height_m = point->position_m.z();
      trial->height_m = std::max(trial->height_m, std::abs(height_m));
      const Eigen::Vector3d row(point->position_m.x(), point->position_m.y(), 1);
      normal += row * row.transpose();
      right += height_m * row;
    }
  }
  const Eigen::Vector3d plane = normal.ldlt().solve(right);
  trial->tilt_deg = kDegPerRad * std::atan(plane.head<2>().norm());
}

absl::Status LayDown(const SimulatedWorld& world, int places, OriginTrial* trial) {
  const server::CalibrationOutcome outcome = server::Calibrate(server::InputOf(world), {});
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  const CalibrationResult& calibration = *outcome.result;
  const std::vector<double>& markers_m = world.true_target().marker_positions_m;
  const std::vector<WandPose> poses = FloorPlaces(world.options().seed, places, markers_m.back());
  StillOptions options;
  options.triangulation.sigma_px = world.options().noise_px;
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<StillPoint> still,
                          FindStillPoints(calibration, FloorRows(world, poses), options));
  std::vector<OriginPoint> points;
  std::vector<Eigen::Vector3d> true_m;
  const RigidTransform& reference_from_world =
      world.cameras()[static_cast<size_t>(CameraIndex(world, calibration.reference_camera))]
          .cam_from_rig;
  size_t second = 0;
  for (const StillPoint& point : still) {
    if (point.place == 0) second = points.size();
    trial->place_count = std::max(trial->place_count, point.place + 1);
    points.push_back({"", point.position_m, point.noise_m2, point.gain, 0});
    if (point.place >= places) {
      return absl::InternalError("a place was found at which the wand never was");
    }
    true_m.push_back(reference_from_world * world.MarkerAt(poses[static_cast<size_t>(point.place)],
                                                           static_cast<size_t>(point.marker)));
  }
  RIGCAL_ASSIGN_OR_RETURN(const OriginSolution solution,
                          FloorOrigin(calibration, points, 0, second, 0, {}));
  const RigidTransform truth = FloorFrame(true_m, std::vector<double>(true_m.size(), 1), 0, second,
                                          0, Eigen::Vector3d::Zero());
  const Eigen::Matrix<double, 6, 1> error = FrameDifference(truth, solution.change.new_from_rig);
  const CameraCovariance covariance = UnpackCameraCovariance(calibration);
  Eigen::Matrix<double, 6, 6> stated = solution.change.Covariance(covariance);
  const Eigen::Vector3d scaled =
      covariance.scale_sigma_rel * solution.change.new_from_rig.translation_m;
  stated.bottomRightCorner<3, 3>() += scaled * scaled.transpose();
  trial->nees = error.dot(stated.ldlt().solve(error));
  trial->stated_tilt_deg = kDegPerRad * solution.rotation_sigma_rad.head<2>().norm();
  MeasureFloor(world, ChangeFrame(calibration, solution.change), trial);
  return absl::OkStatus();
}

}  // namespace

OriginTrial RunOriginTrial(const SimulationOptions& simulation, int places) {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  OriginTrial trial;
  const absl::StatusOr<SimulatedWorld> world = SimulatedWorld::Create(simulation, target);
  trial.status = world.ok() ? LayDown(*world, places, &trial) : world.status();
  return trial;
}

}  // namespace rigcal::accuracy
