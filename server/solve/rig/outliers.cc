// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/outliers.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

constexpr double kOutlierSigmas = 8;
constexpr double kMinScale = 1;
constexpr int kMinMarkers = 4;

// Calls visit(observation, marker, whitened norm); infinite where the camera cannot see it.
template <typename Problem, typename Visit>
void ForEachResidual(Problem& problem, Visit visit) {
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      for (auto& marker : problem.MarkersOf(observation)) {
        const auto residual = MarkerResidualPx(problem, instant, observation, marker);
        visit(observation, marker,
              residual ? (marker.sqrt_information * *residual).norm()
                       : std::numeric_limits<double>::infinity());
      }
    }
  }
}

bool SaysSomething(const BundleProblem& problem, const BundleInstant& instant) {
  int inliers = 0, outliers = 0, cameras = 0;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    const int before = inliers;
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      ++(marker.used ? inliers : outliers);
    }
    cameras += inliers > before ? 1 : 0;
  }
  // Of a point there are never more than one of each camera.
  const bool is_point = problem.IsPoint();
  const int needed = is_point ? 2 : kMinMarkers;
  return outliers == 0 || (inliers >= needed && cameras >= 2);
}

}  // namespace

std::vector<double> OutlierLimits(const BundleProblem& problem) {
  std::vector<std::vector<double>> norms(problem.cameras.size());
  ForEachResidual(problem,
                  [&norms](const BundleObservation& observation, const BundleMarker&, double norm) {
                    // Markers that the camera cannot see are no measure of its noise.
                    if (!std::isfinite(norm)) return;
                    norms[static_cast<size_t>(observation.camera)].push_back(norm);
                  });
  std::vector<double> limits;
  for (std::vector<double>& values : norms) {
    const double scale = values.empty() ? 0 : UpperMedian(&values) / kMedianOfRayleigh;
    limits.push_back(kOutlierSigmas * std::max(kMinScale, scale));
  }
  return limits;
}

int ClassifyOutliers(BundleProblem* problem) {
  const std::vector<double> limits = OutlierLimits(*problem);
  int changed = 0;
  ForEachResidual(*problem,
                  [&](const BundleObservation& observation, BundleMarker& marker, double norm) {
                    const bool used = norm <= limits[static_cast<size_t>(observation.camera)];
                    changed += used != marker.used ? 1 : 0;
                    marker.used = used;
                  });
  for (BundleInstant& instant : problem->instants) {
    if (!instant.used || SaysSomething(*problem, instant)) continue;
    instant.used = false;
    ++changed;
  }
  return changed;
}

}  // namespace rigcal::server
