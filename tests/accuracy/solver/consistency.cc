// SPDX-License-Identifier: Apache-2.0
// Consistency of the solver's uncertainty with its errors, over many seeds. The ground truth is
// drawn from every prior (spans, intrinsics, clock offsets) and everything is estimated. With a
// consistent covariance NEES/dof lies within the interval in 99 of 100 tables. The bound is the
// smallest covariance that any solver could state; NEES against it above 1 is what the solver
// loses.
#include <fmt/core.h>

#include <vector>

#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/consistency_experiment.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

void PrintParts(const std::vector<ConsistencyTrial>& trials) {
  fmt::print(
      "part          dof   NEES/dof  99 % interval   consistent   NEES/dof against the bound\n");
  for (const ConsistencyPart& part : SummariseParts(trials)) {
    if (part.stated.dof() == 0) {
      fmt::print("{:10} {:>6}   not computed\n", part.name, "-");
      continue;
    }
    const Interval interval = part.stated.ConsistentInterval(0.99);
    fmt::print("{:10} {:6} {:10.3f}  [{:.3f}, {:.3f}] {:>12}", part.name, part.stated.dof(),
               part.stated.Ratio(), interval.low, interval.high,
               interval.Contains(part.stated.Ratio()) ? "yes" : "NO");
    if (part.bound.dof() > 0) fmt::print("   {:.3f}", part.bound.Ratio());
    fmt::print("\n");
  }
}

void PrintSigmas(const std::vector<ConsistencyTrial>& trials) {
  fmt::print("\nsigmas in the result: mean of (error/sigma)^2, each value on its own\n");
  for (const MarginalPart& part : SummariseSigmas(trials)) {
    if (part.trials < 2) {
      fmt::print("{:16} not computed\n", part.name);
      continue;
    }
    fmt::print("{:16} {:.3f}  99 % [{:.3f}, {:.3f}]  consistent: {}\n", part.name, part.mean,
               part.interval.low, part.interval.high, part.interval.Contains(1) ? "yes" : "NO");
  }
}

int RunConsistency(const SeedOptions& seeds) {
  ConsistencyOptions options;
  options.camera_count = seeds.camera_count;
  options.duration_s = seeds.duration_s;
  const auto trials = RunAll<ConsistencyTrial>(seeds.count, seeds.threads, [&](int i) {
    return RunConsistencyTrial(options, static_cast<uint32_t>(seeds.first + i));
  });
  int failures = 0;
  for (size_t i = 0; i < trials.size(); ++i) {
    const int seed = seeds.first + static_cast<int>(i);
    if (!trials[i].status.ok()) {
      ++failures;
      fmt::print("seed {:4}: FAILED: {}\n", seed, trials[i].status.ToString());
    } else if (seeds.verbose && trials[i].stated) {
      const RigNees& nees = *trials[i].stated;
      fmt::print(
          "seed {:4}: NEES/dof shape {:.3f}, scale {:.3f}, offsets {:.3f}, intrinsics {:.3f}\n",
          seed, nees.shape.value / nees.shape.dof, nees.scale.value,
          nees.time_offsets.value / nees.time_offsets.dof,
          nees.intrinsics.value / nees.intrinsics.dof);
    }
  }
  fmt::print("{} cameras, {} s at 25 Hz, {} seeds, {} failed\n", seeds.camera_count,
             seeds.duration_s, seeds.count, failures);
  PrintParts(trials);
  PrintSigmas(trials);
  return 0;
}

}  // namespace

Experiment Consistency() {
  SeedOptions defaults;
  defaults.count = 200;
  return SeedExperiment("consistency", "stated uncertainty against the actual errors", defaults,
                        RunConsistency);
}

}  // namespace rigcal::accuracy
