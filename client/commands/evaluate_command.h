// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"
#include "client/results/trajectory_evaluation.h"

namespace rigcal::client {

struct EvaluateCommandOptions {
  std::string estimate;      // CSV of positions in the rig frame
  std::string ground_truth;  // CSV of measured positions, in any frame
  std::string plot;          // SVG to write; empty: none
  bool force = false;        // replace it
  TrajectoryEvaluationOptions evaluation;
  bool keep_time = false;
};

// `rigcal evaluate`: prints the error of triangulated points against ground truth. Returns the exit
// code.
ExitCode Evaluate(const EvaluateCommandOptions& options, CommandContext& context);

}  // namespace rigcal::client
