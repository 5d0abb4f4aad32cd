// SPDX-License-Identifier: Apache-2.0
// Errors of camera positions against the Cramer-Rao bound, over many seeds. Simulated rig of 6
// cameras, 0.3 px, spacing exactly nominal and fixed, intrinsics and clocks fixed. The bound is
// computed at the ground truth from the markers that were seen and are no outliers.
#include <fmt/core.h>

#include <string>
#include <vector>

#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/crb_experiment.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

// `target`: a name, or several joined by + for sessions that are mixed.
void PrintCrbTable(const SeedOptions& seeds, const std::string& target, double outlier_share) {
  CrbOptions options;
  SetTargets(target, &options);
  options.camera_count = seeds.camera_count;
  options.duration_s = seeds.duration_s;
  options.outlier_share = outlier_share;
  const std::vector<CrbTrial> trials = RunAll<CrbTrial>(seeds.count, seeds.threads, [&](int i) {
    return RunCrbTrial(options, static_cast<uint32_t>(seeds.first + i));
  });
  for (size_t i = 0; i < trials.size(); ++i) {
    const int seed = seeds.first + static_cast<int>(i);
    if (!trials[i].status.ok()) {
      fmt::print("seed {:4}: FAILED: {}\n", seed, trials[i].status.ToString());
    } else if (seeds.verbose) {
      fmt::print("seed {:4}: ratio {:.3f}, worst camera {:.3f}, NEES/dof {:.3f}\n", seed,
                 trials[i].Ratio(), trials[i].largest_ratio,
                 trials[i].position_nees.value / trials[i].position_nees.dof);
    }
  }
  const CrbSummary summary = Summarise(trials);
  const Interval efficient = summary.position_nees.ConsistentInterval(0.99);
  fmt::print("{:10} {:7.0f} % {:8} {:9} {:11.3f} {:12.3f} {:12.3f} {:9.3f} [{:.3f}, {:.3f}]\n",
             target, 100 * outlier_share, seeds.count, summary.failures, summary.ratio,
             summary.largest_trial_ratio, summary.largest_camera_ratio,
             summary.position_nees.Ratio(), efficient.low, efficient.high);
}

int RunCrb(const SeedOptions& seeds) {
  fmt::print("{} cameras, {} s at 25 Hz, 0.3 px, only poses estimated\n", seeds.camera_count,
             seeds.duration_s);
  fmt::print(
      "target      outliers    seeds  failures  RMSE/bound   worst seed worst camera  NEES/dof  99 "
      "% "
      "of "
      "efficient solvers\n");
  for (const char* target : {"wand", "body", "plane", "wand+body", "wand+plane", "wand+long",
                             "wand+room", "wand+survey"}) {
    for (const double outlier_share : {0.0, 0.02}) PrintCrbTable(seeds, target, outlier_share);
  }
  return 0;
}

}  // namespace

Experiment Crb() {
  return SeedExperiment("crb", "camera positions against the Cramer-Rao bound", SeedOptions{},
                        RunCrb);
}

}  // namespace rigcal::accuracy
