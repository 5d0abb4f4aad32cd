// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "common/calibration/calibration_options.h"
#include "server/solve/evaluate/evaluated_solve.h"

namespace rigcal::server {

// Models rolling shutters where a solution shows that there are any: line delays are estimated with
// everything else, those that stand out (5 sigma, half a millisecond over the image) become part of
// the times of their rows, and the rig is solved again until they stay the same, then evaluated
// anew. `rig` keeps those times. Where nothing stands out, or the rig cannot be solved with them,
// `rig` and `evaluated` are as they were. Clocks that are not estimated: nothing is done.
//
// CANCELLED.
absl::StatusOr<EvaluatedSolution> ModelRollingShutters(const RigSolveOptions& base,
                                                       const CalibrationOptions& options,
                                                       EvaluatedSolution evaluated,
                                                       RigObservations* rig);

}  // namespace rigcal::server
