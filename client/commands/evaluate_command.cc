// SPDX-License-Identifier: Apache-2.0
#include "client/commands/evaluate_command.h"

#include <fstream>

#include "absl/strings/str_cat.h"

namespace rigcal::client {

ExitCode Evaluate(const EvaluateCommandOptions& options, CommandContext& context) {
  const absl::StatusOr<Trajectories> estimate = ReadTrajectories(options.estimate);
  if (!estimate.ok()) return context.Fail(estimate.status());
  const absl::StatusOr<Trajectories> truth = ReadTrajectories(options.ground_truth);
  if (!truth.ok()) return context.Fail(truth.status());
  TrajectoryEvaluationOptions evaluation_options = options.evaluation;
  evaluation_options.fit_time = !options.keep_time;
  const absl::StatusOr<TrajectoryEvaluation> evaluation =
      EvaluateTrajectories(*estimate, *truth, evaluation_options);
  if (evaluation.ok() && !options.plot.empty()) {
    std::ofstream file(options.plot, std::ios::binary);
    file << PlotAsSvg(*evaluation);
    file.close();
    if (!file) {
      return context.Fail(
          absl::FailedPreconditionError(absl::StrCat(options.plot, ": cannot write the plot")));
    }
  }
  return context.Show(evaluation, FormatTrajectoryEvaluation);
}

}  // namespace rigcal::client
