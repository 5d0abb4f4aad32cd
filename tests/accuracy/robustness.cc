// SPDX-License-Identifier: Apache-2.0
// What bad recordings cost, over many seeds:
//
//   OMP_THREAD_LIMIT=1 build/dev/tests/accuracy.robustness --seeds 20 --duration 60 --threads 2
//
// Position errors against the clean run of the same rigs (no outliers, no dropouts), beside what
// the lost information alone costs (ratio of the Cramer-Rao bounds), and how well outliers and
// reversed labels were found.
#include <fmt/core.h>

#include <cmath>
#include <vector>

#include "tests/accuracy/program_arguments.h"
#include "tests/accuracy/robustness_experiment.h"
#include "tests/accuracy/seed_runs.h"

namespace rigcal::accuracy {
namespace {

void PrintPercent(double share) {
  if (std::isnan(share)) {
    fmt::print(" {:>10}", "-");
  } else {
    fmt::print(" {:9.2f}%", 100 * share);
  }
}

double BoundRatio(const std::vector<RobustnessTrial>& trials,
                  const std::vector<RobustnessTrial>& clean) {
  double above = 0, below = 0;
  for (size_t i = 0; i < trials.size(); ++i) {
    above += trials[i].bound_rms_m * trials[i].bound_rms_m;
    below += clean[i].bound_rms_m * clean[i].bound_rms_m;
  }
  return std::sqrt(above / below);
}

void PrintCase(const RobustnessCase& entry, const ProgramArguments& arguments,
               const std::vector<RobustnessTrial>& trials,
               const std::vector<RobustnessTrial>& clean) {
  int failures = 0;
  double squares = 0;
  FateCounts fates;
  bool shown = false;
  for (size_t i = 0; i < trials.size(); ++i) {
    const int seed = arguments.first_seed + static_cast<int>(i);
    if (!trials[i].status.ok()) {
      ++failures;
      fmt::print("seed {:4}: FAILED: {}\n", seed, trials[i].status.ToString());
      continue;
    }
    squares += trials[i].position_rms_m * trials[i].position_rms_m;
    if (trials[i].fates) {
      shown = true;
      fates += *trials[i].fates;
    }
    if (arguments.verbose) {
      fmt::print("seed {:4}: positions {:.3f} mm (clean {:.3f})\n", seed,
                 1e3 * trials[i].position_rms_m, 1e3 * clean[i].position_rms_m);
    }
  }
  const double rms_m = std::sqrt(squares / (arguments.seeds - failures));
  fmt::print("{:14} {:5} {:6} {:9.3f} {:9.3f} {:9.3f}", entry.name, arguments.seeds, failures,
             1e3 * rms_m, RatioOfRms(trials, clean), BoundRatio(trials, clean));
  if (shown) {
    PrintPercent(fates.OutlierPrecision());
    PrintPercent(fates.OutlierRecall());
    PrintPercent(fates.ReversedRecall());
    fmt::print(" {:8} {:8} {:8}\n", fates.reversed_turned, fates.reversed_removed,
               fates.straight_turned);
  } else {
    fmt::print("  outliers and labels: not computed\n");
  }
}

}  // namespace
}  // namespace rigcal::accuracy

int main(int argc, char** argv) {
  using namespace rigcal::accuracy;
  ProgramArguments arguments;
  arguments.seeds = 20;
  arguments.duration_s = 60;
  int exit_code = 0;
  if (!ReadArguments(argc, argv, "what bad recordings cost", &arguments, &exit_code)) {
    return exit_code;
  }
  fmt::print("{} cameras, {} s at 25 Hz, 0.3 px, all defaults\n", arguments.camera_count,
             arguments.duration_s);
  fmt::print(
      "                             position    times     bound   outliers            reversed "
      "rows             straight\n");
  fmt::print(
      "case           seeds failed    rms mm    clean     times  precision     recall   dealt "
      "with  turned  removed   turned\n");
  std::vector<RobustnessTrial> clean;
  for (const RobustnessCase& entry :
       RobustnessCases(arguments.camera_count, arguments.duration_s)) {
    const auto trials = RunAll<RobustnessTrial>(arguments.seeds, arguments.threads, [&](int i) {
      return RunRobustnessTrial(entry, static_cast<uint32_t>(arguments.first_seed + i));
    });
    if (clean.empty()) clean = trials;
    PrintCase(entry, arguments, trials, clean);
  }
  return 0;
}
