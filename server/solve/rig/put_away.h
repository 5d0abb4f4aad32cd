// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// Most of a solution's memory are the rows moved to their instants, which the observations give at
// any time: PutAway frees them while something else is solved, TakeBack makes them again, bit for
// bit. In between only cameras, clocks, target and the instants' poses may be looked at. Neither
// does anything to a solution that is in that state.
void PutAway(const RigObservations& rig, const RigSolveOptions& options, RigSolution* solution);
void TakeBack(const RigObservations& rig, const RigSolveOptions& options, RigSolution* solution);

}  // namespace rigcal::server
