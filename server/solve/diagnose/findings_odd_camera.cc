// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <vector>

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

struct CameraErrors {
  std::vector<double> errors_px;
  int outliers = 0;
};

}  // namespace

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
    const double value =
        odd.kind == FindingKind::kNoisyCamera ? odd.error_px / kMedianOfRayleigh : medians_px[c];
    causes.push_back({{odd.kind, odd.camera, value, "px", odd.advice}, medians_px[c]});
  }
  return causes;
}

}  // namespace rigcal::server
