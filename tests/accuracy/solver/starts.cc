// SPDX-License-Identifier: Apache-2.0
// Cameras that were started by hand, without any common clock, over many seeds: 24 to 60 frames
// per second, each for 90 s, up to 60 s apart, and beside each the same rows with stamps of one
// clock.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/rig/statistics.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/solver_experiments.h"
#include "tests/accuracy/solver/starts_experiment.h"

namespace rigcal::accuracy {
namespace {

constexpr double kAskedOffsetS = 0.5e-3;

void PrintStartsRuns(const char* target, const char* stamps, const std::vector<StartsRun>& runs,
                     const std::vector<double>& time_ratios) {
  int failed = 0, beyond = 0;
  std::vector<double> offsets_ms, positions_m, cpu_s;
  for (const StartsRun& run : runs) {
    cpu_s.push_back(run.cpu_s);
    if (!run.status.ok()) {
      ++failed;
      continue;
    }
    beyond += run.worst_offset_s > kAskedOffsetS ? 1 : 0;
    offsets_ms.push_back(1e3 * run.worst_offset_s);
    positions_m.push_back(run.position_rms_m);
  }
  fmt::print("{:7} {:10} {:5} {:6} {:9.4f} {:9.4f} {:7} {:9.2f} {:8.2f}", target, stamps,
             runs.size(), failed, InterpolatedQuantile(offsets_ms, 0.5),
             InterpolatedQuantile(offsets_ms, 1), beyond,
             positions_m.empty() ? std::nan("") : 1e3 * RootMeanSquare(positions_m),
             InterpolatedQuantile(cpu_s, 0.5));
  fmt::print(" {:8.2f} {:8.2f}\n", InterpolatedQuantile(time_ratios, 0.5),
             InterpolatedQuantile(time_ratios, 1));
}

void PrintStartsCase(const char* target, const StartsOptions& options, const SeedOptions& seeds) {
  const auto trials = RunAll<StartsTrial>(seeds.count, seeds.threads, [&](int i) {
    return RunStartsTrial(options, static_cast<uint32_t>(seeds.first + i));
  });
  std::vector<StartsRun> aligned, started;
  std::vector<double> ratios;
  for (size_t i = 0; i < trials.size(); ++i) {
    const auto& [one, other] = trials[i];
    aligned.push_back(one);
    started.push_back(other);
    ratios.push_back(other.cpu_s / one.cpu_s);
    const int seed = seeds.first + static_cast<int>(i);
    for (const auto* run : {&one, &other}) {
      if (run->status.ok()) continue;
      fmt::print("seed {:4}, {}: FAILED: {}\n", seed, run == &one ? "one clock" : "started",
                 run->status.ToString());
    }
    if (!seeds.verbose) continue;
    fmt::print(
        "seed {:4}: worst offset {:.4f} and {:.4f} ms, positions {:.3f} and {:.3f} mm, {:.2f} "
        "and {:.2f} s\n",
        seed, 1e3 * one.worst_offset_s, 1e3 * other.worst_offset_s, 1e3 * one.position_rms_m,
        1e3 * other.position_rms_m, one.cpu_s, other.cpu_s);
  }
  PrintStartsRuns(target, "one clock", aligned, {});
  PrintStartsRuns(target, "by hand", started, ratios);
}

int RunStartsTable(const SeedOptions& seeds) {
  StartsOptions options;
  options.camera_count = seeds.camera_count;
  options.duration_s = seeds.duration_s;
  fmt::print("{} cameras of {} to {} fps, {} s each, started up to {} s apart\n",
             options.camera_count, options.slowest_hz, options.fastest_hz, options.duration_s,
             options.latest_start_s);
  fmt::print(
      "                                worst offset, ms     seeds  position  CPU s    times "
      "aligned\n"
      "target  stamps     seeds failed   median   largest >0.5 ms    rms mm   median   median  "
      "largest\n");
  PrintStartsCase("wand", options, seeds);
  options.is_point = true;
  PrintStartsCase("point", options, seeds);
  return 0;
}

}  // namespace

Experiment Starts() {
  SeedOptions defaults;
  defaults.count = 20;
  defaults.duration_s = 90;
  return SeedExperiment("starts", "cameras started by hand, without any common clock", defaults,
                        RunStartsTable);
}

}  // namespace rigcal::accuracy
