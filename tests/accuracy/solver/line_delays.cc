// SPDX-License-Identifier: Apache-2.0
// Rolling shutters of 5 to 50 us a row in every camera, over many seeds: positions, line delays and
// clock offsets against the Cramer-Rao bound and against the stated uncertainty.
#include <fmt/core.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/line_delays_experiment.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

struct ShutterCase {
  const char* name;
  double rate_hz;
  bool free_running;
  double largest_offset_s;
  double speed_m_s = 1.5;  // of the wand, at most
};
constexpr ShutterCase kShutterCases[] = {
    {"50 Hz, exposed together", 50, false, 0.002},
    {"50 Hz, free-running", 50, true, 0.002},
    {"50 Hz, free-running, clocks 0.5 s off", 50, true, 0.5},
    {"25 Hz, exposed together", 25, false, 0.002},
    {"25 Hz, free-running", 25, true, 0.002},
    {"12 Hz, free-running", 12, true, 0.002},
    {"12 Hz, free-running, wand at 4 m/s", 12, true, 0.002, 4},
    {"8 Hz, free-running, wand at 4 m/s", 8, true, 0.002, 4},
};

void PrintNees(const char* name, const NeesSum& sum) {
  const Interval interval = sum.ConsistentInterval(0.99);
  fmt::print("  NEES/dof of {:12} {:6.3f}, 99 % interval {:.3f} to {:.3f}{}\n", name, sum.Ratio(),
             interval.low, interval.high, interval.Contains(sum.Ratio()) ? "" : "  OUTSIDE");
}

void RunShutterCase(const ShutterCase& what, const SeedOptions& seeds) {
  LineDelaysOptions options;
  options.camera_count = seeds.camera_count;
  options.duration_s = seeds.duration_s;
  options.rate_hz = what.rate_hz;
  options.free_running = what.free_running;
  options.largest_offset_s = what.largest_offset_s;
  options.speed_m_s = what.speed_m_s;
  if (seeds.spline) options.trajectory = TrajectoryChoice::kSpline;
  if (seeds.instants) options.trajectory = TrajectoryChoice::kInterpolated;
  const auto trials = RunAll<LineDelaysTrial>(seeds.count, seeds.threads, [&](int i) {
    return RunLineDelaysTrial(options, static_cast<uint32_t>(seeds.first + i));
  });
  static const char* const kGrades[] = {"not evaluated", "good", "usable", "bad"};
  for (size_t i = 0; i < trials.size(); ++i) {
    const LineDelaysTrial& trial = trials[i];
    const int seed = seeds.first + static_cast<int>(i);
    if (!trial.status.ok()) {
      fmt::print("  seed {:4}: FAILED: {}\n", seed, trial.status.ToString());
    } else if (seeds.verbose) {
      fmt::print(
          "  seed {:4}: RMSE/bound {:.3f}, line delays {:.3f}, offsets {:.3f}, {} missed, {}, {}, "
          "{:.1f} CPU s\n",
          seed, std::sqrt(trial.squared_error_m2 / trial.bound_m2),
          std::sqrt(trial.delay_error_s2 / trial.delay_bound_s2),
          std::sqrt(trial.offset_error_s2 / trial.offset_bound_s2), trial.missed,
          kGrades[static_cast<size_t>(trial.grade)], trial.spline ? "spline" : "instants",
          trial.cpu_s);
    }
  }
  const LineDelaysSummary summary = Summarise(trials);
  fmt::print("{}: {} failed, {} cameras without a line delay, {} good, {} splines\n", what.name,
             summary.failed, summary.missed, summary.good, summary.splines);
  fmt::print("  RMSE/bound {:.3f}, of line delays {:.3f} ({:.3f} us RMS), of offsets {:.3f}\n",
             summary.rmse_by_bound, summary.delay_by_bound, 1e6 * summary.delay_rms_s,
             summary.offset_by_bound);
  PrintNees("shape", summary.shape);
  PrintNees("scale", summary.scale);
  PrintNees("offsets", summary.offsets);
  PrintNees("line delays", summary.delays);
}

int RunLineDelays(const SeedOptions& seeds) {
  fmt::print("{} seeds, {} cameras, {} s, rolling shutters of 5 to 50 us a row in all\n",
             seeds.count, seeds.camera_count, seeds.duration_s);
  for (const ShutterCase& one : kShutterCases) {
    if (std::string(one.name).find(seeds.only) == std::string::npos) continue;
    RunShutterCase(one, seeds);
  }
  return 0;
}

}  // namespace

Experiment LineDelays() {
  return SeedExperiment("line_delays", "rolling shutters in every camera against the bound",
                        SeedOptions{}, RunLineDelays);
}

}  // namespace rigcal::accuracy
