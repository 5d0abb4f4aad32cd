// SPDX-License-Identifier: Apache-2.0
#include "server/solve/headline.h"

#include <algorithm>
#include <utility>

#include "server/solve/running/expected_error.h"
#include "server/solve/unused_views.h"

namespace rigcal::server {
namespace {

constexpr size_t kMostPlaces = 1000;
constexpr double kUnusedNoisePx = 0.3;  // of centres, which the error of a point leaves out

}  // namespace

double PointError::StatedM() const {
  return AllTogether(by_covariance_m, with_lenses_m, fold_factor);
}

ErrorBasis PointError::Basis() const {
  const double stated_m = StatedM(), noise_m = fold_factor * by_covariance_m;
  if (!(stated_m > 0)) return ErrorBasis::kUnknown;
  // The parts add up in squares.
  if (stated_m * stated_m > 2 * noise_m * noise_m) return ErrorBasis::kLenses;
  return fold_factor > 1 ? ErrorBasis::kFolds : ErrorBasis::kCovariance;
}

std::optional<PointError> MeasurePointError(const RigObservations& rig,
                                            const EvaluatedSolution& evaluated) {
  if (!evaluated.uncertainty || !IsMetric(rig, evaluated.options) || !rig.target.IsLine()) {
    return std::nullopt;
  }
  const BundleProblem& problem = evaluated.solution.built.problem;
  const WavedGrid grid = MeasureWavedGrid(problem, kMostPlaces);
  const auto expect = [&](const RigUncertainty& uncertainty) {
    PointGains gains =
        ComputeGains(problem, rig.index.cameras, uncertainty.parameters, grid, kUnusedNoisePx);
    return ComputeExpectedError(std::move(gains), uncertainty.shape_covariance, grid);
  };
  const ExpectedError by_covariance = expect(*evaluated.uncertainty);
  ExpectedError all = by_covariance;
  if (evaluated.lenses_kept.spread > 0) {
    all = expect(WithKeptLenses(*evaluated.uncertainty, evaluated.lenses_kept));
  }
  PointError error;
  error.by_covariance_m = by_covariance.p95_m;
  error.with_lenses_m = std::max(error.by_covariance_m, all.p95_m);
  if (all.p95_m > 0) error.bound_factor = all.p95_bound_m / all.p95_m;
  error.fold_factor = evaluated.predicted.fold_factor;
  return error;
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
  if (!result.scale_known) return headline;
  if (const auto error = MeasurePointError(rig, evaluated)) {
    headline.point_error_m = error->StatedM();
    headline.point_error_bound_m = error->BoundM();
    headline.point_error_basis = error->Basis();
  }
  return headline;
}

}  // namespace rigcal::server
