// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/diagnose/odd_camera.h"

namespace rigcal::server {
namespace {

// A camera is looked at where its median error is so large, and so many times that of the others;
// or where most of its markers are outliers.
constexpr double kOddPx = 1.5, kOddTimes = 4;
constexpr double kOddOutliers = 0.5;
constexpr size_t kMinOddMarkers = 60, kMinOddCameras = 4;

// A camera shakes where most of its error is common to the markers of a row, and not along their
// motion in the image, as that of a wrong time is.
constexpr double kShakesShare = 0.75, kAcrossShare = 0.2;
constexpr size_t kMinShakenRows = 60;

// A marker of one camera is displaced where it is so far beside the others of its row, in the same
// direction of the image, and so many times as far as in the other cameras: whatever is wrong with
// the target itself turns with it.
constexpr double kDisplacedPx = 1, kDisplacedTimes = 4;
constexpr size_t kMinDisplacedCameras = 3;

struct CameraErrors {
  std::vector<double> errors_px;
  int outliers = 0;
};

// What the rows of one camera have in common, per marker: medians over the rows.
struct RowErrors {
  std::vector<double> whole_px, common_px, across_px;

  // The rows as wholes are displaced, each by another amount.
  bool Shakes() const {
    if (common_px.size() < kMinShakenRows) return false;
    const double whole = UpperMedian(whole_px);
    return UpperMedian(common_px) > kShakesShare * whole &&
           UpperMedian(across_px) > kAcrossShare * whole;
  }
};

RowErrors RowErrorsOf(const BundleProblem& problem, const TrialProblem& trial, size_t rig_camera) {
  RowErrors errors;
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      if (trial.rig_camera[static_cast<size_t>(observation.camera)] != rig_camera) continue;
      Eigen::Vector2d sum = Eigen::Vector2d::Zero(), velocity = Eigen::Vector2d::Zero();
      double sum_px2 = 0;
      int count = 0;
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        const auto residual = MarkerResidualPx(problem, instant, observation, marker);
        if (!residual) continue;
        sum += *residual;
        sum_px2 += residual->squaredNorm();
        velocity += marker.velocity_px_s;
        ++count;
      }
      if (count < 2) continue;
      const Eigen::Vector2d common = sum / count;
      const Eigen::Vector2d across =
          Eigen::Vector2d(-velocity.y(), velocity.x()) / std::max(velocity.norm(), 1e-9);
      errors.whole_px.push_back(std::sqrt(sum_px2 / count));
      errors.common_px.push_back(common.norm());
      errors.across_px.push_back(std::abs(common.dot(across)));
    }
  }
  return errors;
}

Cause ShakingCause(const std::string& camera, const RowErrors& errors, double error_px) {
  const double common_px = UpperMedian(errors.common_px) / kMedianOfRayleigh;
  return {{FindingKind::kCameraMoved, camera, common_px, "px",
           absl::StrFormat(
               "it shakes: the markers of a row are displaced together, by %.1f px (one "
               "sigma) from row to row, in all directions; that is %.0f %% of its "
               "error. Clamp its mount, keep it away from what vibrates, and record "
               "again",
               common_px, 100 * UpperMedian(errors.common_px) / UpperMedian(errors.whole_px))},
          error_px,
          true};
}

// By marker, over the rows of a camera: how far it is seen beside where it should be, more than the
// other markers of the row are on average.
struct MarkerShifts {
  std::vector<std::vector<double>> x_px, y_px;

  Eigen::Vector2d Median(size_t marker) const {
    return {UpperMedian(x_px[marker]), UpperMedian(y_px[marker])};
  }
};

std::vector<MarkerShifts> ShiftsOf(const TrialProblem& trial, size_t camera_count) {
  const BundleProblem& problem = trial.problem;
  const size_t marker_count = problem.MarkerCount();
  std::vector<MarkerShifts> all(camera_count);
  for (MarkerShifts& own : all) own.x_px.resize(marker_count), own.y_px.resize(marker_count);
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used || instant.is_rigid) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      std::vector<std::pair<size_t, Eigen::Vector2d>> row;
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        const auto residual = MarkerResidualPx(problem, instant, observation, marker);
        if (!residual) continue;
        row.emplace_back(static_cast<size_t>(marker.marker), *residual);
        sum += *residual;
      }
      if (row.size() < 2) continue;
      MarkerShifts& own = all[trial.rig_camera[static_cast<size_t>(observation.camera)]];
      for (const auto& [marker, residual] : row) {
        const Eigen::Vector2d others = (sum - residual) / static_cast<double>(row.size() - 1);
        // Residuals are projected minus seen.
        own.x_px[marker].push_back(others.x() - residual.x());
        own.y_px[marker].push_back(others.y() - residual.y());
      }
    }
  }
  return all;
}

}  // namespace

std::vector<Cause> FindDisplacedMarkers(const CauseInput& input) {
  const size_t camera_count = input.rig.index.cameras.size();
  const std::vector<MarkerShifts> shifts = ShiftsOf(input.trial, camera_count);
  struct Shift {
    size_t marker = 0;
    Eigen::Vector2d px = Eigen::Vector2d::Zero();
  };
  std::vector<Shift> largest(camera_count);
  std::vector<double> sizes_px;
  for (size_t c = 0; c < camera_count; ++c) {
    for (size_t m = 0; m < shifts[c].x_px.size(); ++m) {
      if (shifts[c].x_px[m].size() < kMinOddMarkers) continue;
      const Eigen::Vector2d px = shifts[c].Median(m);
      if (px.norm() > largest[c].px.norm()) largest[c] = {m, px};
    }
    sizes_px.push_back(largest[c].px.norm());
  }
  std::vector<Cause> causes;
  if (camera_count < kMinDisplacedCameras) return causes;
  const double typical_px = LowerMedian(sizes_px);
  for (size_t c = 0; c < camera_count; ++c) {
    const Shift& shift = largest[c];
    const double px = shift.px.norm();
    if (px < kDisplacedPx || px < kDisplacedTimes * typical_px) continue;
    causes.push_back(
        {{FindingKind::kNoisyCamera, input.rig.index.cameras[c].camera, px, "px",
          absl::StrFormat("marker %d is seen %.1f px beside the others (x %+.1f, y %+.1f), in the "
                          "same direction in most rows, and in no other camera so. Look at what "
                          "its detector takes for the centre of that marker: a reflection, a part "
                          "of the sphere, another light",
                          static_cast<int>(shift.marker), px, shift.px.x(), shift.px.y())},
         px});
  }
  return causes;
}

std::vector<Cause> FindOddCameras(const CauseInput& input) {
  // What is left when all other causes are taken out.
  const BundleProblem& problem = input.trial.problem;
  std::vector<CameraErrors> errors(input.rig.index.cameras.size());
  if (errors.size() < kMinOddCameras) return {};
  ForEachMarker(problem, [&](size_t i, const BundleObservation& observation, size_t m) {
    CameraErrors& own = errors[input.trial.rig_camera[static_cast<size_t>(observation.camera)]];
    const auto residual =
        MarkerResidualPx(problem, problem.instants[i], observation, problem.markers[m]);
    own.errors_px.push_back(residual ? residual->norm() : 100);
    own.outliers += problem.markers[m].used ? 0 : 1;
  });
  std::vector<double> medians_px;
  for (const CameraErrors& own : errors) {
    medians_px.push_back(own.errors_px.empty() ? 0 : UpperMedian(own.errors_px));
  }
  const double typical_px = LowerMedian(medians_px);
  std::vector<Cause> causes;
  for (size_t c = 0; c < errors.size(); ++c) {
    const size_t count = errors[c].errors_px.size();
    if (count < kMinOddMarkers) continue;
    const bool noisy = medians_px[c] > std::max(kOddPx, kOddTimes * typical_px);
    const bool lost = errors[c].outliers > kOddOutliers * static_cast<double>(count);
    if (!noisy && !lost) continue;
    const OddCamera odd =
        JudgeCamera(input.rig, input.evaluated.solution, input.rig.index.cameras[c].camera);
    if (odd.kind == FindingKind::kUnspecified) continue;
    if (odd.kind == FindingKind::kNoisyCamera) {
      const RowErrors rows = RowErrorsOf(problem, input.trial, c);
      if (rows.Shakes()) {
        causes.push_back(ShakingCause(odd.camera, rows, medians_px[c]));
        continue;
      }
    }
    const double value =
        odd.kind == FindingKind::kNoisyCamera ? odd.error_px / kMedianOfRayleigh : medians_px[c];
    causes.push_back({{odd.kind, odd.camera, value, "px", odd.advice}, medians_px[c]});
  }
  return causes;
}

}  // namespace rigcal::server
