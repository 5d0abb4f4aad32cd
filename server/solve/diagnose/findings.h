// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/calibration/calibration.h"
#include "server/solve/evaluate/evaluated_solve.h"

namespace rigcal::server {

// Names what is wrong with a rig or a recording from the pattern of the residuals, with numbers and
// where it can be computed the error that would be left. docs/findings.md lists the kinds and their
// thresholds. `result` holds the cameras and the target as reported.
//
// An explanation counts when its parameter is significant and it also takes away a part of the
// error that matters; a recording of many thousand markers makes everything significant. Worst
// first; what `evaluated` found comes last. Cancelled or failed trials give no finding.
std::vector<Finding> FindCauses(const RigObservations& rig, const EvaluatedSolution& evaluated,
                                const CalibrationResult& result);

}  // namespace rigcal::server
