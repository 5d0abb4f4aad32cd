// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/status.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// Gives rates to the clocks that are seen to run differently: all are tried, then those that stood
// out alone, until all of them still do. What could not be solved has no rates.
// `solution` may be put away on return. CANCELLED.
absl::Status TryRates(const RigObservations& rig, RigSolveOptions* options, RigSolution* solution);

}  // namespace rigcal::server
