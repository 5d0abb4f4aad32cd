// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration_options.h"
#include "server/solve/evaluate/held_out.h"
#include "server/solve/evaluate/held_out_choice.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"
#include "server/solve/rig/trajectory_fit.h"

namespace rigcal::server {

// Whether the target's path through time (trajectory_fit.h) is worth a trial. As asked for; else
// where interpolation and rows that are in no instant cost more than a seventh of what the rows
// say, and most rows are in one: between those alone the path is not known. Outliers count as
// neither. Rigs and recordings of which there is much are not tried: they have enough rows, and it
// takes time.
bool TriesPath(const RigObservations& rig, const RigSolveOptions& options,
               const RigSolution& solution, TrajectoryChoice choice);

// A fold solved by instants and by a path, evaluated on what it leaves out.
struct PathFold {
  RigSolution solution;                        // by a path
  std::vector<EvaluatedErrors> before, after;  // of instants and of the path, by held-out block
};

// Follows the target through the rows that fold `fold` of `blocks` keeps, as `options` have it.
// `by_instants` is the fold's solution, whose rows may be put away. `like`: see SolveOnTrajectory,
// whose errors are passed on.
absl::StatusOr<PathFold> FollowInFold(const RigObservations& rig, const RigSolveOptions& options,
                                      const TimeBlocks& blocks, int fold, int block_count,
                                      const TrajectoryFit* like, RigSolution* by_instants);

// Whether it is kept, by `gain` over instants. Held-out errors are those of instants in both cases,
// and mostly the centres' noise: they must not become larger by more than chance.
bool KeepsPath(const HeldOutGain& gain, TrajectoryChoice choice);

}  // namespace rigcal::server
