// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "server/solve/evaluate/held_out.h"
#include "server/solve/evaluate/lens_comparison.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// Whether the intrinsics are refined or stay as they were given.
struct IntrinsicsChoice {
  bool refine = false;
  std::vector<bool> refine_in_fold;  // chosen without what the fold leaves out
  // Refined ones fit better between neighbouring times only, and are not used for that.
  bool refined_by_chance = false;
  double given_px = 0;  // held-out error with the given ones
  Finding finding;      // what was chosen, and why
};

// For each fold of `blocks`, two inner solves hold out blocks of what the fold leaves: refined
// intrinsics are chosen where they make the held-out error smaller by 2 %. Over all folds together
// they must also do so over long blocks of time (held_out_choice.h), clearly; else no fold refines.
// Blocks of fewer than 10 instants say nothing of that. The given ones are kept where there is too
// little data to hold any out.
//
// `solution` is that of `base`, and may be put away; the solves begin at `initial`. CANCELLED.
absl::StatusOr<IntrinsicsChoice> ChooseIntrinsics(const RigObservations& rig,
                                                  const RigInitialization& initial,
                                                  const RigSolution& solution,
                                                  const TimeBlocks& blocks,
                                                  const RigSolveOptions& base);

// Where refined intrinsics were chosen that are not expected to put the cameras nearer: the given
// ones are kept, in all folds.
void KeepGiven(const LensComparison& lenses, IntrinsicsChoice* choice);

}  // namespace rigcal::server
