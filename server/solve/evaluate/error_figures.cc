// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/error_figures.h"

#include <algorithm>
#include <cmath>

#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
ErrorFigures Figures(std::vector<double> errors_px) {
  ErrorFigures figures;
  if (errors_px.empty()) return figures;
  std::ranges::sort(errors_px);
  double sum = 0, squares = 0;
  for (const double error : errors_px) {
    sum += error;
    squares += error * error;
  }
  const auto count = static_cast<double>(errors_px.size());
  figures.mean_px = sum / count;
  figures.rms_px = std::sqrt(squares / count);
  figures.median_px = InterpolatedQuantile(errors_px, 0.5);
  figures.p95_px = InterpolatedQuantile(errors_px, 0.95);
  figures.marker_count = static_cast<uint32_t>(errors_px.size());
  return figures;
}

std::vector<Residuals> ComputeResiduals(const BundleProblem& problem) {
  const size_t count = problem.cameras.size();
  std::vector<std::vector<double>> all(count), inlier(count);
  std::vector<Residuals> residuals(count);
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      const auto camera = static_cast<size_t>(observation.camera);
      ++residuals[camera].observation_count;
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        if (!marker.used) ++residuals[camera].outlier_count;
        const auto residual = MarkerResidualPx(problem, instant, observation, marker);
        if (!residual) continue;
        all[camera].push_back(residual->norm());
        if (marker.used) inlier[camera].push_back(residual->norm());
      }
    }
  }
  for (size_t c = 0; c < count; ++c) {
    residuals[c].all = Figures(std::move(all[c]));
    residuals[c].inlier = Figures(std::move(inlier[c]));
  }
  return residuals;
}

}  // namespace rigcal::server
