// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "server/solve/evaluate/given_intrinsics.h"
#include "server/solve/evaluate/kept_lenses.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"
#include "server/solve/running/running_estimate.h"

namespace rigcal::server {

// What a running estimate is reported from.
struct RunningSolution {
  RigObservations rig;
  RigSolveOptions options;  // with the thinning of instants
  RigSolution solution;
  RigUncertainty uncertainty;  // of the thinned instants
  GivenIntrinsicsTest lens_test;
  KeptLenses lenses_kept;  // of given intrinsics that the solution keeps
  std::optional<HeldOutCheck> held_out;
  int instant_count = 0;  // before thinning
};

// Solves a rig whose cameras are connected, on about `input.max_views` views: from `input.start`
// where that fits, else from nothing, with the search for clock offsets. Refines intrinsics where
// those given are seen to be wrong, and checks the solution on held-out blocks of time if
// `input.check_held_out`. The tracks of `input` are not looked at. Errors as SolveRig and
// ComputeUncertainty.
absl::StatusOr<RunningSolution> SolveRunning(RigObservations rig,
                                             std::vector<ClockCorrection> clocks,
                                             const RunningInput& input);

}  // namespace rigcal::server
