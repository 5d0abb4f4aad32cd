// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "common/calibration/calibration.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// Estimates line delays where a rolling shutter stands out, together with everything else. What
// could not be solved so stays as it is. `solution` may be put away on return. CANCELLED.
absl::Status TryLineDelays(const RigObservations& rig, RigSolveOptions* options,
                           RigSolution* solution);

// The cameras whose estimated line delay stands out, by 8 sigma and by 2 ms over the image, or is
// held at the longest that is possible (line_delay_limit.h).
std::vector<Finding> RollingShutterFindings(const RigObservations& rig,
                                            const RigSolveOptions& options,
                                            const RigSolution& solution,
                                            const RigUncertainty& uncertainty);

// Solves again without line delays, from the solution. What looked like a rolling shutter with the
// given intrinsics may be none with refined ones: where none is left that stands out, the result
// has none. What cannot be solved so stays as it is. CANCELLED.
absl::Status DropLineDelays(const RigObservations& rig, RigSolveOptions* options,
                            RigSolution* solution, RigUncertainty* uncertainty);

}  // namespace rigcal::server
