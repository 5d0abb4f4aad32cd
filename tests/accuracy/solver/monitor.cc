// SPDX-License-Identifier: Apache-2.0
// A camera that is bumped after the calibration: whether a few seconds of waving find and name it,
// whether they raise an alarm without a bump, and how good the repair is.
#include <fmt/core.h>

#include <algorithm>
#include <vector>

#include "absl/strings/str_join.h"
#include "tests/accuracy/rig/statistics.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/monitor_experiment.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

constexpr double kMm = 1000;

void PrintBump(const char* name, const std::vector<MonitorTrial>& trials,
               BumpOutcome MonitorTrial::*which) {
  int runs = 0, found = 0, others = 0, repaired = 0, good = 0;
  std::vector<double> sigmas, repaired_m, full_m;
  double others_moved_m = 0;
  for (const MonitorTrial& trial : trials) {
    if (!trial.status.ok()) continue;
    const BumpOutcome& bump = trial.*which;
    ++runs;
    found += bump.moved == std::vector<std::string>{bump.camera} ? 1 : 0;
    others += std::ranges::any_of(bump.moved, [&](const auto& c) { return c != bump.camera; });
    sigmas.push_back(bump.sigmas);
    if (!bump.repaired) continue;
    ++repaired;
    good += bump.good ? 1 : 0;
    repaired_m.push_back(bump.repaired_error_m);
    full_m.push_back(bump.full_error_m);
    others_moved_m = std::max(others_moved_m, bump.others_moved_m);
  }
  if (runs == 0) return;
  std::ranges::sort(sigmas);
  fmt::print("{:18} named {} of {}, another one {}; sigmas: least {:.1f}, median {:.1f}\n", name,
             found, runs, others, sigmas.front(), sigmas[sigmas.size() / 2]);
  if (repaired == 0) return;
  fmt::print(
      "{:18} repaired {}, good {}; error {:.3f} mm rms, of a full calibration {:.3f} mm ({:.2f} "
      "times); others changed by {:.1e} mm at most\n",
      "", repaired, good, kMm * RootMeanSquare(repaired_m), kMm * RootMeanSquare(full_m),
      RootMeanSquare(repaired_m) / RootMeanSquare(full_m), kMm * others_moved_m);
}

int RunMonitor(const SeedOptions& seeds) {
  MonitorOptions options;
  options.camera_count = seeds.camera_count;
  options.duration_s = seeds.duration_s;
  const auto trials = RunAll<MonitorTrial>(seeds.count, seeds.threads, [&](int i) {
    const MonitorTrial trial = RunMonitorTrial(options, static_cast<uint32_t>(seeds.first + i));
    if (seeds.verbose) {
      fmt::print("seed {}: {} quiet [{}] {} turn [{}] {:.1f} {} shift [{}] {:.1f} {}\n",
                 seeds.first + i, trial.status.ToString(), absl::StrJoin(trial.quiet_moved, ","),
                 trial.quiet_problem, absl::StrJoin(trial.turn.moved, ","), trial.turn.sigmas,
                 trial.turn.problem, absl::StrJoin(trial.shift.moved, ","), trial.shift.sigmas,
                 trial.shift.problem);
      std::fflush(stdout);
    }
    return trial;
  });
  int failed = 0, alarms = 0;
  for (size_t i = 0; i < trials.size(); ++i) {
    const MonitorTrial& trial = trials[i];
    if (!trial.status.ok()) {
      ++failed;
      fmt::print("seed {:4}: FAILED: {}\n", seeds.first + static_cast<int>(i),
                 trial.status.ToString());
      continue;
    }
    alarms += trial.quiet_moved.empty() && trial.quiet_problem.empty() ? 0 : 1;
  }
  fmt::print("{} cameras, calibrated in {} s, looked at for {} s at 25 Hz, {} seeds, {} failed\n",
             seeds.camera_count, seeds.duration_s, options.look_s, seeds.count, failed);
  fmt::print("quiet              {} false alarms of {}\n", alarms, seeds.count - failed);
  PrintBump("turned 0.05 deg", trials, &MonitorTrial::turn);
  PrintBump("shifted 2 mm", trials, &MonitorTrial::shift);
  return 0;
}

}  // namespace

Experiment Monitor() {
  SeedOptions defaults;
  defaults.count = 100;
  return SeedExperiment("monitor", "a bumped camera found by a few seconds of waving, and repaired",
                        defaults, RunMonitor);
}

}  // namespace rigcal::accuracy
