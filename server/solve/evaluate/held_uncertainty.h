// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/status.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/held_rig.h"
#include "server/solve/rig/rig_solution.h"

namespace rigcal::server {

// Adds the held cameras (HeldRig) to a covariance in which they are fixed. With x what was solved,
// h the held poses and H the information about both, x follows a change of h by
//   dx = -H_xx^-1 H_xh dh,
// so that the covariance of x grows by that of h carried through, and x and h become correlated.
// Where no camera is exact, the column of H for the first of them follows from the others': moving
// all cameras alike changes nothing that is observed.
// The scale is that of the held rig. Errors as of ComputeInformation.
absl::Status AddHeldUncertainty(const RigSolution& solution, const HeldRig& held,
                                RigUncertainty* uncertainty);

}  // namespace rigcal::server
