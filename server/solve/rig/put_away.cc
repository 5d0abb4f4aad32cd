// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/put_away.h"

#include <cstddef>
#include <utility>
#include <vector>

#include "server/solve/rig/problem_builder.h"

namespace rigcal::server {

void PutAway(const RigObservations& rig, const RigSolveOptions& options, RigSolution* solution) {
  if (solution->put_away) return;
  BundleProblem& problem = solution->built.problem;
  RigSolution::PutAway& kept = solution->put_away.emplace();
  kept.used.reserve(problem.markers.size());
  for (const BundleMarker& marker : problem.markers) kept.used.push_back(marker.used);
  bool has_diameter = rig.target.diameter_m > 0;
  for (const auto& [session, target] : rig.other_targets) {
    has_diameter = has_diameter || target.diameter_m > 0;
  }
  if (has_diameter && IsMetric(rig, options)) {
    kept.centres_px.reserve(problem.markers.size());
    for (const BundleMarker& marker : problem.markers) kept.centres_px.push_back(marker.centre_px);
  }
  // An empty list in braces would keep their memory.
  problem.markers = std::vector<BundleMarker>();
  problem.observations = std::vector<BundleObservation>();
  solution->built.sources = std::vector<MarkerSource>();
}

void TakeBack(const RigObservations& rig, const RigSolveOptions& options, RigSolution* solution) {
  if (!solution->put_away) return;
  BundleProblem& problem = solution->built.problem;
  const RigSolution::PutAway& kept = *solution->put_away;
  BuiltProblem again =
      BuildProblem(rig.Parts(), rig.tracks, solution->motions, rig.index, solution->clocks,
                   solution->instants.instants, options.sigma_px);
  for (size_t m = 0; m < again.problem.markers.size(); ++m) {
    again.problem.markers[m].used = kept.used[m];
    if (!kept.centres_px.empty()) again.problem.markers[m].centre_px = kept.centres_px[m];
  }
  problem.markers = std::move(again.problem.markers);
  problem.observations = std::move(again.problem.observations);
  solution->built.sources = std::move(again.sources);
  solution->put_away.reset();
}

}  // namespace rigcal::server
