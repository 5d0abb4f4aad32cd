// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/rig_solution.h"

#include <cstddef>
#include <cstdint>

namespace rigcal::server {

bool IsFlipped(const RigSolution& solution, const BundleObservation& observation) {
  if (observation.marker_count == 0) return false;
  const MarkerSource& source =
      solution.built.sources[static_cast<size_t>(observation.first_marker)];
  return solution.motions[static_cast<size_t>(source.track)].IsFlipped(source.observation);
}

RigInitialization InitializationFrom(const RigSolution& solution) {
  const BundleProblem& problem = solution.built.problem;
  RigInitialization initial;
  initial.cameras = problem.cameras;
  initial.marker_positions_m = problem.target.marker_positions_m;
  initial.points_m = problem.rigid_target.points_m;
  initial.distance = problem.distance;
  initial.clocks = solution.clocks;
  initial.line_delay_s = solution.line_delay_s;
  for (size_t c = 0; c < initial.line_delay_s.size(); ++c) {
    initial.line_delay_s[c] += problem.cameras[c].line_delay_s;
  }
  for (size_t k = 0; k < initial.clocks.size(); ++k) {
    initial.clocks[k].time_offset_s += problem.clocks[k].time_offset_s;
    initial.clocks[k].time_rate += problem.clocks[k].time_rate;
  }
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    if (!problem.instants[i].used) continue;
    const InstantMember& first = solution.instants.instants[i].members.front();
    initial.instants[{first.track, first.observation}] = {
        problem.instants[i].origin_m, problem.instants[i].direction, problem.instants[i].rotation};
  }
  return initial;
}

}  // namespace rigcal::server
