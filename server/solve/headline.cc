// SPDX-License-Identifier: Apache-2.0
#include "server/solve/headline.h"

#include <algorithm>
#include <cmath>

#include "server/solve/running/expected_error.h"
#include "server/solve/unused_views.h"

namespace rigcal::server {
namespace {

constexpr size_t kMostPlaces = 1000;
constexpr double kUnusedNoisePx = 0.3;  // of centres, which the error of a point leaves out

// The scatter of a few folds says a sigma to such a factor only.
constexpr double kFoldsTell = 2;

}  // namespace

double UnstatedFactor(const PredictedError& predicted) {
  if (!(predicted.stated_m > 0) || !std::isfinite(predicted.stated_m)) return 1;
  return std::max({1.0, predicted.by_intrinsics_m / predicted.stated_m,
                   predicted.by_folds_m / (kFoldsTell * predicted.stated_m)});
}

Headline MakeHeadline(const RigObservations& rig, const EvaluatedSolution& evaluated,
                      const std::map<std::string, CameraCounts>& counts,
                      const std::vector<Refusal>& refused, const CalibrationResult& result) {
  Headline headline;
  double sum_px = 0, markers = 0;
  for (const CalibratedCamera& camera : result.cameras) {
    sum_px += camera.residuals.inlier.mean_px * camera.residuals.inlier.marker_count;
    markers += camera.residuals.inlier.marker_count;
  }
  if (markers > 0) headline.used_mean_px = sum_px / markers;
  uint64_t lost = 0, all = 0;
  for (const UnusedViews& views : CountUnusedViews(counts, refused)) {
    lost += views.lost;
    all += views.all;
  }
  if (all > 0) headline.unused_share = static_cast<double>(lost) / static_cast<double>(all);
  const BundleProblem& problem = evaluated.solution.built.problem;
  // The places are those of a wand.
  if (!evaluated.uncertainty || !result.scale_known || !rig.target.IsLine()) return headline;
  const WavedGrid grid = MeasureWavedGrid(problem, kMostPlaces);
  PointGains gains = ComputeGains(problem, rig.index.cameras, evaluated.uncertainty->parameters,
                                  grid, kUnusedNoisePx);
  headline.point_error_m =
      UnstatedFactor(evaluated.predicted) *
      ComputeExpectedError(std::move(gains), evaluated.uncertainty->shape_covariance, grid).p95_m;
  return headline;
}

}  // namespace rigcal::server
