// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// Associates, initializes unless given initial values, and alternates bundle adjustment, flipping
// of labels, classification of outliers, and interpolation at the new clock corrections until
// nothing moves. Flipped observations are found anew in each solve. In each session the clock of
// the reference camera (or else the first) keeps its correction: time has no origin. (Of many
// clocks another one is held on the way, see HoldsOthers.)
//
// FAILED_PRECONDITION: no instants, not connected, cannot be placed. CANCELLED.
absl::StatusOr<RigSolution> SolveRig(const RigObservations& rig,
                                     const std::vector<ClockCorrection>& clocks,
                                     const RigSolveOptions& options,
                                     const RigInitialization* initial = nullptr);

// Associates by the clocks of `initial` and places the target in the instants with cameras, clocks
// and target held as they are there; labels are flipped as in `solution`. Errors as of SolveRig.
absl::StatusOr<RigSolution> PlaceRig(const RigObservations& rig, const RigSolveOptions& options,
                                     const RigInitialization& initial, const RigSolution& solution);

}  // namespace rigcal::server
