// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <vector>

#include "absl/strings/str_format.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/rig/outliers.h"

namespace rigcal::server {
namespace {

constexpr int kMinFlipped = 3;
constexpr double kMinShare = 0.002;
// Of the views that do not fit as they are: of those of a camera that has moved, say, a few fit the
// other way round by chance.
constexpr double kMinShareOfUnfit = 0.1;

bool IsFit(const BundleProblem& problem, const BundleObservation& observation) {
  return std::ranges::all_of(problem.MarkersOf(observation), &BundleMarker::used);
}

// The observation's markers fit with flipped labels, and do not as they are.
bool FitsFlipped(const BundleProblem& problem, const BundleInstant& instant,
                 const BundleObservation& observation, double limit) {
  const auto fits = [&](BundleMarker marker) {
    marker.marker = problem.target.WandOf(marker.marker).Mirrored(marker.marker);
    const auto residual = MarkerResidualPx(problem, instant, observation, marker);
    return residual && (marker.sqrt_information * *residual).norm() <= limit;
  };
  return std::ranges::all_of(problem.MarkersOf(observation), fits) && !IsFit(problem, observation);
}

}  // namespace

std::vector<Cause> FindFlippedMarkers(const CauseInput& input) {
  const BundleProblem& problem = input.evaluated.solution.built.problem;
  if (problem.target.marker_positions_m.size() < 2) return {};  // it has no other end
  const std::vector<double> limits = OutlierLimits(problem);
  struct Count {
    int observations = 0, flipped = 0, unfit = 0;
  };
  std::vector<Count> counts(problem.cameras.size());
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used || instant.is_rigid) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      const bool flipped = IsFlipped(input.evaluated.solution, observation);
      if (observation.marker_count < 2 && !flipped) continue;
      const auto c = static_cast<size_t>(observation.camera);
      ++counts[c].observations;
      const bool fits_flipped = flipped || FitsFlipped(problem, instant, observation, limits[c]);
      counts[c].flipped += fits_flipped ? 1 : 0;
      counts[c].unfit += flipped || !IsFit(problem, observation) ? 1 : 0;
    }
  }
  std::vector<Cause> causes;
  for (size_t c = 0; c < counts.size(); ++c) {
    const double share =
        static_cast<double>(counts[c].flipped) / std::max(1, counts[c].observations);
    if (counts[c].flipped < kMinFlipped || share < kMinShare ||
        counts[c].flipped < kMinShareOfUnfit * counts[c].unfit) {
      continue;
    }
    causes.push_back(
        {{FindingKind::kFlippedLabels, problem.cameras[c].name, 100 * share, "%",
          absl::StrFormat(
              "%d of its %d wand views fit with the markers counted from the other end. "
              "Check its detector and the spacing it was given",
              counts[c].flipped, counts[c].observations)},
         0});
  }
  return causes;
}

}  // namespace rigcal::server
