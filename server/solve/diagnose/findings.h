// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/calibration/calibration.h"
#include "server/solve/evaluate/evaluated_solve.h"

namespace rigcal::server {

// One cause of error with what it costs, by which causes are sorted.
struct Cause {
  Finding finding;
  double cost_px = 0;  // mean error of the camera (or of all) that goes away when it is removed
};

// What was found, worst first.
struct Causes {
  std::vector<Cause> causes;
  // With every cause taken out the rig fits: each camera's error is that of a usable calibration.
  // Where it does not, something else is wrong, and no figure of a cause holds.
  bool explain_all = false;
};

// Names what is wrong with a rig or a recording from the pattern of the residuals, with numbers and
// where it can be computed the error that would be left. docs/findings.md lists the kinds and their
// thresholds. `result` holds the cameras and the target as reported.
//
// An explanation counts when its parameter is significant and it also takes away a part of the
// error that matters; a recording of many thousand markers makes everything significant. Worst
// first; what `evaluated` found comes last. Cancelled or failed trials give no finding.
Causes FindCauses(const RigObservations& rig, const EvaluatedSolution& evaluated,
                  const CalibrationResult& result);

// The findings of a result. `figures_hold` false: what is a cause of error comes as a candidate,
// with what it would explain instead of its size.
std::vector<Finding> FindingsOf(const Causes& causes, bool figures_hold);

}  // namespace rigcal::server
