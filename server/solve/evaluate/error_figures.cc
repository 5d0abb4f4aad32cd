// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/error_figures.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/geometry/marker_rays.h"
#include "server/solve/geometry/triangulation.h"

namespace rigcal::server {
namespace {

using MarkerPoints = std::vector<std::optional<Eigen::Vector3d>>;

MarkerPoints TriangulateMarkers(const BundleProblem& problem,
                                const std::vector<Intrinsics>& intrinsics,
                                const BundleInstant& instant, int min_cameras) {
  std::vector<std::vector<CameraRay>> views(problem.MarkerCount());
  for (const MarkerRay& seen : UsedMarkerRays(problem, intrinsics, instant)) {
    if (seen.has_ray) views[static_cast<size_t>(seen.marker)].push_back(seen.ray);
  }
  MarkerPoints points(views.size());
  for (size_t m = 0; m < views.size(); ++m) {
    if (static_cast<int>(views[m].size()) >= min_cameras) points[m] = Triangulate(views[m]);
  }
  return points;
}

}  // namespace

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

LengthErrors MeasureLengths(const BundleProblem& problem,
                            const std::vector<double>& expected_positions_m, int min_cameras) {
  if (expected_positions_m.empty()) return {};  // a rigid target has no spans
  const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(problem);
  LengthErrors errors(expected_positions_m.size() - 1);
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used || instant.is_rigid) continue;
    const MarkerPoints points = TriangulateMarkers(problem, intrinsics, instant, min_cameras);
    for (size_t m = 0; m < errors.size(); ++m) {
      if (!points[m] || !points[m + 1]) continue;
      const double expected_m = expected_positions_m[m + 1] - expected_positions_m[m];
      errors[m].push_back((*points[m + 1] - *points[m]).norm() - expected_m);
    }
  }
  return errors;
}

std::vector<SpanError> SummariseSpans(const LengthErrors& errors,
                                      const std::vector<double>& expected_positions_m) {
  std::vector<SpanError> spans;
  for (size_t s = 0; s < errors.size(); ++s) {
    SpanError span;
    span.length_m = expected_positions_m[s + 1] - expected_positions_m[s];
    span.count = static_cast<uint32_t>(errors[s].size());
    double sum = 0, squares = 0;
    for (const double error : errors[s]) {
      sum += error;
      squares += error * error;
    }
    if (span.count > 0) {
      span.mean_error_m = sum / span.count;
      span.error_rms_m = std::sqrt(squares / span.count);
    }
    spans.push_back(span);
  }
  return spans;
}

double OverallRms(const LengthErrors& errors) {
  double squares = 0;
  size_t count = 0;
  for (const std::vector<double>& span : errors) {
    for (const double error : span) squares += error * error;
    count += span.size();
  }
  return count == 0 ? 0 : std::sqrt(squares / static_cast<double>(count));
}

}  // namespace rigcal::server
