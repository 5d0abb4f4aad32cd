// SPDX-License-Identifier: Apache-2.0
// Errors of camera positions against the Cramer-Rao bound, over many seeds:
//
//   OMP_THREAD_LIMIT=1 build/dev/tests/accuracy.crb --seeds 100 --threads 2
//
// Simulated rig of 6 cameras, 0.3 px, spacing exactly nominal and fixed, intrinsics and clocks
// fixed. The bound is computed at the truth from the markers that were seen and are no outliers.
#include <fmt/core.h>

#include <vector>

#include "tests/accuracy/crb_experiment.h"
#include "tests/accuracy/program_arguments.h"
#include "tests/accuracy/seed_runs.h"

namespace rigcal::accuracy {
namespace {

void PrintTable(const ProgramArguments& arguments, double outlier_share) {
  CrbOptions options;
  options.camera_count = arguments.camera_count;
  options.duration_s = arguments.duration_s;
  options.outlier_share = outlier_share;
  const std::vector<CrbTrial> trials = RunAll<CrbTrial>(
      arguments.seeds, arguments.threads,
      [&](int i) { return RunCrbTrial(options, static_cast<uint32_t>(arguments.first_seed + i)); });
  for (size_t i = 0; i < trials.size(); ++i) {
    const int seed = arguments.first_seed + static_cast<int>(i);
    if (!trials[i].status.ok()) {
      fmt::print("seed {:4}: FAILED: {}\n", seed, trials[i].status.ToString());
    } else if (arguments.verbose) {
      fmt::print("seed {:4}: ratio {:.3f}, worst camera {:.3f}, NEES/dof {:.3f}\n", seed,
                 trials[i].Ratio(), trials[i].largest_ratio,
                 trials[i].position_nees.value / trials[i].position_nees.dof);
    }
  }
  const CrbSummary summary = Summarise(trials);
  const Interval honest = summary.position_nees.Honest(0.99);
  fmt::print("{:7.0f} % {:8} {:9} {:11.3f} {:12.3f} {:12.3f} {:9.3f} [{:.3f}, {:.3f}]\n",
             100 * outlier_share, arguments.seeds, summary.failures, summary.ratio,
             summary.largest_trial_ratio, summary.largest_camera_ratio,
             summary.position_nees.Ratio(), honest.low, honest.high);
}

}  // namespace
}  // namespace rigcal::accuracy

int main(int argc, char** argv) {
  using namespace rigcal::accuracy;
  ProgramArguments arguments;
  int exit_code = 0;
  if (!ReadArguments(argc, argv, "camera positions against the Cramer-Rao bound", &arguments,
                     &exit_code)) {
    return exit_code;
  }
  fmt::print("{} cameras, {} s at 25 Hz, 0.3 px, poses alone estimated\n", arguments.camera_count,
             arguments.duration_s);
  fmt::print(
      "outliers    seeds  failures  RMSE/bound   worst seed worst camera  NEES/dof  99 % of "
      "an efficient solver\n");
  for (const double outlier_share : {0.0, 0.02}) PrintTable(arguments, outlier_share);
  return 0;
}
