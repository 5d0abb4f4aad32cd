// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/calibration_options.h"
#include "server/solve/evaluate/held_out.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {

struct EvaluatedSolution {
  RigSolution solution;                       // of everything
  RigSolveOptions options;                    // as chosen
  std::optional<EvaluatedErrors> held_out;    // none: too little to hold anything out
  std::optional<RigUncertainty> uncertainty;  // none: the data leave something undetermined
  std::vector<Finding> findings;              // about what was chosen, and why
};

// Solves the rig and judges it on data that the judged solve did not use: time in blocks of 2 s,
// with guards of 0.2 s; every fourth block stays out of a solve and is judged by it, four times, so
// that each block is judged once. A choice (`auto`) is made for each of the four anew within its
// rest, on blocks of it that stay out of two solves in the same way; it never sees the blocks that
// judge. What is published is then solved on everything, with the choice the four make together.
// The judged solves begin at the estimates of the first solve, and end at the optimum of their own
// data.
//
// Clock rates are estimated where the data can tell at least one of them from zero.
// The first solve begins at `first_start`, if given, else from nothing. It is checked for clocks
// matched with the wrong moment (time_check.h) and for a wrong minimum (restart.h).
absl::StatusOr<EvaluatedSolution> SolveAndEvaluate(const RigObservations& rig,
                                                   const std::vector<ClockCorrection>& clocks,
                                                   const RigSolveOptions& base,
                                                   const CalibrationOptions& options,
                                                   const RigInitialization* first_start = nullptr);

}  // namespace rigcal::server
