// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "server/solve/evaluate/held_out.h"
#include "server/solve/evaluate/held_out_choice.h"
#include "server/solve/evaluate/predicted_error.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"
#include "server/solve/rig/trajectory_fit.h"

namespace rigcal::server {

// What a way to solve does on the blocks that its folds leave out.
struct FoldErrors {
  EvaluatedErrors held_out;      // of all folds together
  std::vector<FoldPoses> poses;  // by fold that could be solved
};

struct FoldResults {
  FoldErrors by_instants;
  FoldErrors by_path;                         // empty where no path is tried
  HeldOutGain path_gain;                      // of the path over the instants
  std::shared_ptr<const TrajectoryFit> path;  // of the last fold; null: none was found
};

// Solves the rig once for each fold of `blocks`, without what the fold leaves out, and evaluates it
// on that. `solution`: that of all data, which may be put away; `initial`: where the folds begin;
// `base`: its options. `refine_in_fold`: whether intrinsics are refined, by fold (empty: as in
// `base`). `tries_path`: each fold is solved with a path of the target through time, too
// (path_choice.h). A fold that cannot be solved is left out. CANCELLED.
absl::StatusOr<FoldResults> EvaluateFolds(const RigObservations& rig,
                                          const RigInitialization& initial,
                                          const RigSolution& solution, const TimeBlocks& blocks,
                                          const RigSolveOptions& base,
                                          const std::vector<bool>& refine_in_fold, bool tries_path);

}  // namespace rigcal::server
