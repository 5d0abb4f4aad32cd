// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/index_paired_solve.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/camera/intrinsics_vector.h"
#include "common/status/status_macros.h"
#include "common/triangulate/point_fit.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "tests/bench/reference_bundle.h"

namespace rigcal::accuracy {
namespace {

constexpr size_t kMinInstants = 10;

using server::BundleInstant;
using server::BundleMarker;
using server::BundleObservation;
using server::BundleProblem;

// Where the cameras of `start` see the wand; none where the rays meet nowhere.
std::optional<BundleInstant> StartOf(const std::vector<CalibratedCamera>& cameras,
                                     const std::vector<const Observation*>& rows,
                                     const std::vector<double>& positions_m) {
  std::vector<Eigen::Vector3d> points_m;
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  double middle_position_m = 0;
  for (size_t m = 0; m < positions_m.size(); ++m) {
    std::vector<PixelView> views;
    for (size_t c = 0; c < rows.size(); ++c) {
      views.push_back({static_cast<int>(c), rows[c]->markers[m].centre_px});
    }
    const std::optional<FittedPoint> point = FitPoint(cameras, views);
    if (!point) return std::nullopt;
    points_m.push_back(point->position_m);
    middle_m += point->position_m / static_cast<double>(positions_m.size());
    middle_position_m += positions_m[m] / static_cast<double>(positions_m.size());
  }
  BundleInstant instant;
  instant.direction = (points_m.back() - points_m.front()).normalized();
  instant.origin_m = middle_m - middle_position_m * instant.direction;
  return instant;
}

void AddInstant(BundleInstant instant, const std::vector<const Observation*>& rows,
                BundleProblem* problem) {
  instant.first_observation = static_cast<int>(problem->observations.size());
  instant.observation_count = static_cast<int>(rows.size());
  problem->instants.push_back(instant);
  for (size_t c = 0; c < rows.size(); ++c) {
    BundleObservation& observation = problem->observations.emplace_back();
    observation.camera = observation.clock = static_cast<int>(c);
    observation.first_marker = static_cast<int>(problem->markers.size());
    observation.marker_count = static_cast<int>(rows[c]->markers.size());
    for (size_t m = 0; m < rows[c]->markers.size(); ++m) {
      BundleMarker& marker = problem->markers.emplace_back();
      marker.centre_px = rows[c]->markers[m].centre_px;
      marker.marker = static_cast<int>(m);
    }
  }
}

bool SeesAll(const Observation& row, size_t markers) {
  return row.VisibleCount() == static_cast<int>(markers);
}

// The cameras of `start` in the order of the tracks, with lenses and clocks as they were given.
absl::StatusOr<std::vector<CalibratedCamera>> GivenCameras(const server::CalibrationInput& input,
                                                           const CalibrationResult& start) {
  std::vector<CalibratedCamera> cameras;
  for (const server::CameraTrack& track : input.tracks) {
    const auto found =
        std::ranges::find(start.cameras, track.camera.camera, &CalibratedCamera::camera);
    if (found == start.cameras.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the start of the index-paired solve has no camera ", track.camera.camera));
    }
    CalibratedCamera& camera = cameras.emplace_back();
    camera.camera = found->camera;
    camera.image_size_px = found->image_size_px;
    camera.cam_from_rig = found->cam_from_rig;
    camera.intrinsics = *track.camera.intrinsics;
    camera.clock_id = found->clock_id;
    camera.time_epoch_s = found->time_epoch_s;
  }
  return cameras;
}

BundleProblem MakeProblem(const server::CalibrationInput& input,
                          const std::vector<CalibratedCamera>& cameras) {
  BundleProblem problem;
  problem.target.marker_positions_m = input.target.marker_positions_m;
  for (const CalibratedCamera& given : cameras) {
    server::BundleCamera& camera = problem.cameras.emplace_back();
    camera.name = given.camera;
    camera.cam_from_rig = given.cam_from_rig;
    camera.pose_fixed = problem.cameras.size() == 1;
    camera.model = given.intrinsics.model;
    camera.intrinsics = ToVector(given.intrinsics);
    problem.clocks.emplace_back().clock_id = given.camera;
  }
  size_t row_count = input.tracks.front().observations.size();
  for (const server::CameraTrack& track : input.tracks) {
    row_count = std::min(row_count, track.observations.size());
  }
  const std::vector<double>& positions_m = input.target.marker_positions_m;
  for (size_t i = 0; i < row_count; ++i) {
    std::vector<const Observation*> rows;
    for (const server::CameraTrack& track : input.tracks) {
      if (SeesAll(track.observations[i], positions_m.size()))
        rows.push_back(&track.observations[i]);
    }
    if (rows.size() < input.tracks.size()) continue;
    const auto instant = StartOf(cameras, rows, positions_m);
    if (instant) AddInstant(*instant, rows, &problem);
  }
  return problem;
}

void StoreResiduals(const BundleProblem& problem, std::vector<CalibratedCamera>* cameras) {
  std::vector<double> sums_px(cameras->size()), squares_px2(cameras->size());
  for (const BundleInstant& instant : problem.instants) {
    ForEachUsedMarker(
        problem, instant, [&](const BundleObservation& observation, const BundleMarker& marker) {
          const auto residual = server::MarkerResidualPx(problem, instant, observation, marker);
          if (!residual) return;
          const auto c = static_cast<size_t>(observation.camera);
          sums_px[c] += residual->norm();
          squares_px2[c] += residual->squaredNorm();
          ++(*cameras)[c].residuals.all.marker_count;
        });
  }
  for (size_t c = 0; c < cameras->size(); ++c) {
    Residuals& residuals = (*cameras)[c].residuals;
    residuals.all.mean_px = sums_px[c] / residuals.all.marker_count;
    residuals.all.rms_px = std::sqrt(squares_px2[c] / residuals.all.marker_count);
    residuals.inlier = residuals.all;
  }
}

}  // namespace

absl::StatusOr<CalibrationResult> SolveIndexPaired(const server::CalibrationInput& input,
                                                   const CalibrationResult& start) {
  if (input.target.kind != TargetKind::kWand || input.tracks.empty()) {
    return absl::InvalidArgumentError("the index-paired solve takes rows of a wand");
  }
  RIGCAL_ASSIGN_OR_RETURN(std::vector<CalibratedCamera> cameras, GivenCameras(input, start));
  BundleProblem problem = MakeProblem(input, cameras);
  if (problem.instants.size() < kMinInstants) {
    return absl::FailedPreconditionError(
        absl::StrCat("all ", cameras.size(), " cameras see the whole wand in ",
                     problem.instants.size(), " rows of one index, fewer than ", kMinInstants));
  }
  server::BundleOptions options;
  options.robust = false;
  RIGCAL_ASSIGN_OR_RETURN(const server::BundleSummary summary,
                          testing::SolveReferenceBundle(options, &problem));
  if (!summary.converged) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the index-paired solve has not converged in ", summary.iterations, " iterations"));
  }
  for (size_t c = 0; c < cameras.size(); ++c) {
    cameras[c].cam_from_rig = problem.cameras[c].cam_from_rig;
  }
  StoreResiduals(problem, &cameras);
  CalibrationResult result;
  result.scale_known = true;
  result.reference_camera = start.reference_camera;
  result.instant_count = static_cast<uint32_t>(problem.instants.size());
  result.target.given = input.target;
  result.target.marker_positions_m = input.target.marker_positions_m;
  result.cameras = std::move(cameras);
  std::ranges::sort(result.cameras, {}, &CalibratedCamera::camera);
  return result;
}

}  // namespace rigcal::accuracy
