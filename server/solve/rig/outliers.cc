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

// Whitened norms by marker; infinite where its camera cannot see it, NaN where the instant has no
// pose.
std::vector<double> WhitenedNorms(const BundleProblem& problem) {
  std::vector<double> norms(problem.markers.size(), std::numeric_limits<double>::quiet_NaN());
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        const auto residual = MarkerResidualPx(problem, instant, observation, marker);
        norms[problem.IndexOf(marker)] = residual ? (marker.sqrt_information * *residual).norm()
                                                  : std::numeric_limits<double>::infinity();
      }
    }
  }
  return norms;
}

std::vector<double> LimitsOf(const BundleProblem& problem, const std::vector<double>& norms) {
  std::vector<std::vector<double>> norms_of_camera(problem.cameras.size());
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      std::vector<double>& own = norms_of_camera[static_cast<size_t>(observation.camera)];
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        const double norm = norms[problem.IndexOf(marker)];
        // Markers that the camera cannot see are no measure of its noise.
        if (std::isfinite(norm)) own.push_back(norm);
      }
    }
  }
  std::vector<double> limits;
  for (std::vector<double>& values : norms_of_camera) {
    const double scale = values.empty() ? 0 : UpperMedian(&values) / kMedianOfRayleigh;
    limits.push_back(kOutlierSigmas * std::max(kMinScale, scale));
  }
  return limits;
}

}  // namespace

std::vector<double> OutlierLimits(const BundleProblem& problem) {
  return LimitsOf(problem, WhitenedNorms(problem));
}

int ClassifyOutliers(BundleProblem* problem) {
  const std::vector<double> norms = WhitenedNorms(*problem);
  const std::vector<double> limits = LimitsOf(*problem, norms);
  int changed = 0;
  for (BundleInstant& instant : problem->instants) {
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem->ObservationsOf(instant)) {
      const double limit = limits[static_cast<size_t>(observation.camera)];
      for (BundleMarker& marker : problem->MarkersOf(observation)) {
        const bool used = norms[problem->IndexOf(marker)] <= limit;
        changed += used != marker.used ? 1 : 0;
        marker.used = used;
      }
    }
    if (SaysSomething(*problem, instant)) continue;
    instant.used = false;
    ++changed;
  }
  return changed;
}

double InlierShare(const BundleProblem& problem) {
  double used = 0;
  for (const BundleMarker& marker : problem.markers) used += marker.used ? 1 : 0;
  return used / static_cast<double>(std::max<size_t>(1, problem.markers.size()));
}

}  // namespace rigcal::server
