// SPDX-License-Identifier: Apache-2.0
// Whether the solver's uncertainty is honest, over many seeds:
//
//   OMP_THREAD_LIMIT=1 build/dev/tests/accuracy.honesty --seeds 200 --threads 2
//
// The truth is drawn from every prior (spans, intrinsics, clock offsets) and everything is
// estimated. An honest covariance gives NEES/dof within the interval in 99 of 100 tables. The bound
// is the least that any solver could state; NEES against it above 1 is what the solver gives away.
#include <fmt/core.h>

#include <vector>

#include "tests/accuracy/consistency_experiment.h"
#include "tests/accuracy/program_arguments.h"
#include "tests/accuracy/seed_runs.h"

namespace rigcal::accuracy {
namespace {

void PrintParts(const std::vector<ConsistencyTrial>& trials) {
  fmt::print(
      "part          dof   NEES/dof  99 % interval       honest   NEES/dof against the bound\n");
  for (const ConsistencyPart& part : SummariseParts(trials)) {
    if (part.stated.dof() == 0) {
      fmt::print("{:10} {:>6}   not computed\n", part.name, "-");
      continue;
    }
    const Interval honest = part.stated.Honest(0.99);
    fmt::print("{:10} {:6} {:10.3f}  [{:.3f}, {:.3f}] {:>12}", part.name, part.stated.dof(),
               part.stated.Ratio(), honest.low, honest.high,
               honest.Contains(part.stated.Ratio()) ? "yes" : "NO");
    if (part.bound.dof() > 0) fmt::print("   {:.3f}", part.bound.Ratio());
    fmt::print("\n");
  }
}

void PrintSigmas(const std::vector<ConsistencyTrial>& trials) {
  fmt::print("\nsigmas in the result: mean of (error/sigma)^2, each value by itself\n");
  for (const MarginalPart& part : SummariseSigmas(trials)) {
    if (part.trials < 2) {
      fmt::print("{:16} not computed\n", part.name);
      continue;
    }
    fmt::print("{:16} {:.3f}  99 % [{:.3f}, {:.3f}]  honest: {}\n", part.name, part.mean,
               part.interval.low, part.interval.high, part.interval.Contains(1) ? "yes" : "NO");
  }
}

}  // namespace
}  // namespace rigcal::accuracy

int main(int argc, char** argv) {
  using namespace rigcal::accuracy;
  ProgramArguments arguments;
  arguments.seeds = 200;
  int exit_code = 0;
  if (!ReadArguments(argc, argv, "honesty of the solver's uncertainty", &arguments, &exit_code)) {
    return exit_code;
  }
  ConsistencyOptions options;
  options.camera_count = arguments.camera_count;
  options.duration_s = arguments.duration_s;
  const auto trials = RunAll<ConsistencyTrial>(arguments.seeds, arguments.threads, [&](int i) {
    return RunConsistencyTrial(options, static_cast<uint32_t>(arguments.first_seed + i));
  });
  int failures = 0;
  for (size_t i = 0; i < trials.size(); ++i) {
    const int seed = arguments.first_seed + static_cast<int>(i);
    if (!trials[i].status.ok()) {
      ++failures;
      fmt::print("seed {:4}: FAILED: {}\n", seed, trials[i].status.ToString());
    } else if (arguments.verbose && trials[i].stated) {
      const RigNees& nees = *trials[i].stated;
      fmt::print(
          "seed {:4}: NEES/dof shape {:.3f}, scale {:.3f}, offsets {:.3f}, intrinsics {:.3f}\n",
          seed, nees.shape.value / nees.shape.dof, nees.scale.value,
          nees.time_offsets.value / nees.time_offsets.dof,
          nees.intrinsics.value / nees.intrinsics.dof);
    }
  }
  fmt::print("{} cameras, {} s at 25 Hz, {} seeds, {} failed\n", arguments.camera_count,
             arguments.duration_s, arguments.seeds, failures);
  PrintParts(trials);
  PrintSigmas(trials);
  return 0;
}
