// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/outliers.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

// Calls visit(observation, marker, whitened norm); infinite where the camera cannot see it.
template <typename Problem, typename Visit>
void ForEachResidual(Problem& problem, Visit visit) {
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      for (auto& marker : problem.MarkersOf(observation)) {
        Eigen::Vector2d residual;
        double norm = std::numeric_limits<double>::infinity();
        if (MarkerResidualPx(problem, instant, observation, marker, &residual)) {
          norm = (marker.sqrt_information * residual).norm();
        }
        visit(observation, marker, norm);
      }
    }
  }
}

bool SaysSomething(const BundleProblem& problem, const BundleInstant& instant,
                   const OutlierOptions& options) {
  int inliers = 0, outliers = 0, cameras = 0;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    const int before = inliers;
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      ++(marker.used ? inliers : outliers);
    }
    cameras += inliers > before ? 1 : 0;
  }
  // Of a point there are never more than one of each camera.
  const bool is_point = problem.target.marker_positions_m.size() == 1;
  const int needed = is_point ? std::min(2, options.min_markers) : options.min_markers;
  return outliers == 0 || (inliers >= needed && cameras >= 2);
}

}  // namespace

std::vector<double> CameraScales(const BundleProblem& problem, const OutlierOptions& options) {
  std::vector<std::vector<double>> norms(problem.cameras.size());
  ForEachResidual(problem,
                  [&norms](const BundleObservation& observation, const BundleMarker&, double norm) {
                    // Markers that the camera cannot see are no measure of its noise.
                    if (!std::isfinite(norm)) return;
                    norms[static_cast<size_t>(observation.camera)].push_back(norm);
                  });
  std::vector<double> scales;
  for (std::vector<double>& values : norms) {
    double scale = options.min_scale;
    if (!values.empty()) scale = std::max(scale, UpperMedian(&values) / kMedianOfRayleigh);
    scales.push_back(scale);
  }
  return scales;
}

int ClassifyOutliers(const OutlierOptions& options, BundleProblem* problem) {
  const std::vector<double> scales = CameraScales(*problem, options);
  int changed = 0;
  ForEachResidual(
      *problem, [&](const BundleObservation& observation, BundleMarker& marker, double norm) {
        const bool used = norm <= options.sigmas * scales[static_cast<size_t>(observation.camera)];
        changed += used != marker.used ? 1 : 0;
        marker.used = used;
      });
  for (BundleInstant& instant : problem->instants) {
    if (!instant.used || SaysSomething(*problem, instant, options)) continue;
    instant.used = false;
    ++changed;
  }
  return changed;
}

}  // namespace rigcal::server
