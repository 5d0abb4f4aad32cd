// SPDX-License-Identifier: Apache-2.0
#include "client/commands/evaluate_command.h"

#include "common/file/durable_file.h"
#include "common/file/may_write.h"

namespace rigcal::client {

ExitCode Evaluate(const EvaluateCommandOptions& options, CommandContext& context) {
  if (!options.plot.empty()) {
    const absl::Status free = CheckOutputFile(options.plot, options.force, "--plot");
    if (!free.ok()) return context.Fail(free);
  }
  const absl::StatusOr<Trajectories> estimate = ReadTrajectories(options.estimate);
  if (!estimate.ok()) return context.Fail(estimate.status());
  const absl::StatusOr<Trajectories> truth = ReadTrajectories(options.ground_truth);
  if (!truth.ok()) return context.Fail(truth.status());
  TrajectoryEvaluationOptions evaluation_options = options.evaluation;
  evaluation_options.fit_time = !options.keep_time;
  const absl::StatusOr<TrajectoryEvaluation> evaluation =
      EvaluateTrajectories(*estimate, *truth, evaluation_options);
  if (evaluation.ok() && !options.plot.empty()) {
    const absl::Status written = WriteOutputFile(options.plot, PlotAsSvg(*evaluation));
    if (!written.ok()) return context.Fail(written);
  }
  return context.Show(evaluation, FormatTrajectoryEvaluation);
}

}  // namespace rigcal::client
