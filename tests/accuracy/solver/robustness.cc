// SPDX-License-Identifier: Apache-2.0
// The cost of bad recordings, over many seeds: position errors against the clean run of the same
// rigs (no outliers, no dropouts), beside the cost of the lost information alone (ratio of the
// Cramer-Rao bounds), and how well outliers and flipped labels were found.
#include <fmt/core.h>

#include <cmath>
#include <vector>

#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/robustness_experiment.h"
#include "tests/accuracy/solver/solver_experiments.h"

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

void PrintRobustnessCase(const RobustnessCase& entry, const SeedOptions& seeds,
                         const std::vector<RobustnessTrial>& trials,
                         const std::vector<RobustnessTrial>& clean) {
  int failures = 0;
  double squares = 0;
  FateCounts fates;
  bool shown = false;
  for (size_t i = 0; i < trials.size(); ++i) {
    const int seed = seeds.first + static_cast<int>(i);
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
    if (seeds.verbose) {
      fmt::print("seed {:4}: positions {:.3f} mm (clean {:.3f})\n", seed,
                 1e3 * trials[i].position_rms_m, 1e3 * clean[i].position_rms_m);
    }
  }
  const double rms_m = std::sqrt(squares / (seeds.count - failures));
  fmt::print("{:14} {:5} {:6} {:9.3f} {:9.3f} {:9.3f}", entry.name, seeds.count, failures,
             1e3 * rms_m, RatioOfRms(trials, clean), BoundRatio(trials, clean));
  if (shown) {
    PrintPercent(fates.OutlierPrecision());
    PrintPercent(fates.OutlierRecall());
    PrintPercent(fates.FlippedRecall());
    fmt::print(" {:8} {:8} {:8}\n", fates.flipped_corrected, fates.flipped_removed,
               fates.good_flipped);
  } else {
    fmt::print("  outliers and labels: not computed\n");
  }
}

int RunRobustness(const SeedOptions& seeds) {
  fmt::print("{} cameras, {} s at 25 Hz, 0.3 px, all defaults\n", seeds.camera_count,
             seeds.duration_s);
  fmt::print("{:26} {:>9} {:>9} {:>9} {:>21} {:>28} {:>8}\n", "", "position", "times", "bound",
             "outliers", "flipped rows", "good");
  fmt::print("{:14} {:>5} {:>6} {:>9} {:>9} {:>9} {:>10} {:>10} {:>10} {:>8} {:>8} {:>8}\n", "case",
             "seeds", "failed", "rms mm", "clean", "times", "precision", "recall", "handled",
             "correct.", "removed", "flipped");
  std::vector<RobustnessTrial> clean;
  for (const RobustnessCase& entry : RobustnessCases(seeds.camera_count, seeds.duration_s)) {
    const auto trials = RunAll<RobustnessTrial>(seeds.count, seeds.threads, [&](int i) {
      return RunRobustnessTrial(entry, static_cast<uint32_t>(seeds.first + i));
    });
    if (clean.empty()) clean = trials;
    PrintRobustnessCase(entry, seeds, trials, clean);
  }
  return 0;
}

}  // namespace

Experiment Robustness() {
  SeedOptions defaults;
  defaults.count = 20;
  defaults.duration_s = 60;
  return SeedExperiment("robustness", "cost of bad recordings; outliers and flipped labels found",
                        defaults, RunRobustness);
}

}  // namespace rigcal::accuracy
