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
  // By camera, where each was chosen for itself: its given ones stay. Empty: of none.
  std::vector<bool> keep;
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

// The choice in a large rig of which each instant is seen by few cameras: for each camera by
// itself, on targets that the others place (placed_views.h), in groups of ten of its views or more.
// Those of a camera are refined where its held-out error falls by 2 %, by three standard errors or
// of the ranks. Where those of all cameras together fall so clearly, by two of them, all are
// refined: what lenses have in common hides in the places that the others give. Every fold does
// what was chosen so. `problem`: solved with the given intrinsics. The time grows with the number
// of rows.
IntrinsicsChoice ChooseIntrinsicsByCamera(const RigObservations& rig, const BundleProblem& problem,
                                          const RigSolveOptions& base, int folds);

// Where refined intrinsics were chosen that are not expected to put the cameras nearer: the given
// ones are kept, in all folds.
void KeepGiven(const LensComparison& lenses, IntrinsicsChoice* choice);

}  // namespace rigcal::server
