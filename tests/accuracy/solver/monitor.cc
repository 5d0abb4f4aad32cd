// SPDX-License-Identifier: Apache-2.0
// A camera that is bumped after the calibration: whether a few seconds of waving find and name it,
// whether they raise an alarm without a bump, and how good the repair is.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "tests/accuracy/rig/statistics.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/monitor_experiment.h"
#include "tests/accuracy/solver/recording.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

constexpr double kMm = 1000;

void PrintBump(const char* name, const std::vector<MonitorTrial>& trials,
               BumpOutcome MonitorTrial::*which, double full_s) {
  int runs = 0, found = 0, others = 0, repaired = 0, good = 0;
  std::vector<double> sigmas, repaired_m, same_m, full_m;
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
    same_m.push_back(bump.same_rows_error_m);
    full_m.push_back(bump.full_error_m);
    others_moved_m = std::max(others_moved_m, bump.others_moved_m);
  }
  if (runs == 0) return;
  std::ranges::sort(sigmas);
  fmt::print("{:18} named {} of {}, another one {}; sigmas: least {:.1f}, median {:.1f}\n", name,
             found, runs, others, sigmas.front(), sigmas[sigmas.size() / 2]);
  if (repaired == 0) return;
  fmt::print(
      "{:18} repaired {}, good {}; error {:.3f} mm rms; of a full calibration {:.3f} mm from the "
      "same "
      "rows ({:.2f} times), {:.3f} mm from {} s ({:.2f} times); others changed by {:.1e} mm at "
      "most\n",
      "", repaired, good, kMm * RootMeanSquare(repaired_m), kMm * RootMeanSquare(same_m),
      RootMeanSquare(repaired_m) / RootMeanSquare(same_m), kMm * RootMeanSquare(full_m), full_s,
      RootMeanSquare(repaired_m) / RootMeanSquare(full_m), kMm * others_moved_m);
}

// The real recording in two halves, each camera turned in turn.
int RunRecording() {
  const absl::StatusOr<server::CalibrationInput> recording = WandRecording();
  if (!recording.ok()) {
    fmt::print(stderr, "{}\n", recording.status().ToString());
    return 1;
  }
  constexpr double kDegrees = 180 / M_PI;
  const Eigen::Vector3d turn_rad = 0.1 / kDegrees * Eigen::Vector3d(1, 1, 0.3).normalized();
  fmt::print(
      "the real recording in two halves, one camera's rows turned by 0.1 degrees about its centre "
      "in "
      "the second\n{:10} {:>12} {:>12} {:>7} {:>16} {:>9} {:>18} {:>6} {:>14} {:>6} {:>10}\n",
      "camera", "quiet", "named", "sigmas", "turned, deg", "repair", "turned, deg", "sigmas",
      "centre, mm", "sigmas", "others, mm");
  for (size_t camera = 0; camera < recording->tracks.size(); ++camera) {
    const RecordingTrial trial = RunRecordingTrial(*recording, camera, turn_rad);
    if (!trial.status.ok()) {
      fmt::print("{}: {}\n", camera, trial.status.ToString());
      continue;
    }
    const server::CameraDifference &found = trial.found, &back = trial.back;
    fmt::print("{:10} {:>12} {:>12} {:7.1f} {:8.4f}+-{:.4f}", trial.camera,
               trial.quiet_problem.empty()
                   ? absl::StrCat("[", absl::StrJoin(trial.quiet_moved, ","), "]")
                   : "cannot tell",
               trial.problem.empty() ? absl::StrJoin(trial.moved, ",") : "cannot tell",
               found.sigmas, kDegrees * found.rotation_rad, kDegrees * found.rotation_sigma_rad);
    if (!trial.repaired) {
      fmt::print(" not repaired: {}\n", trial.repair_problem);
      continue;
    }
    fmt::print(" {:>9} {:10.4f}+-{:.4f} {:6.1f} {:7.2f}+-{:.2f} {:6.1f} {:10.1e}\n",
               trial.grade == QualityGrade::kGood     ? "good"
               : trial.grade == QualityGrade::kUsable ? "usable"
                                                      : "bad",
               kDegrees * back.rotation_rad, kDegrees * back.rotation_sigma_rad,
               std::abs(back.rotation_rad - turn_rad.norm()) / back.rotation_sigma_rad,
               kMm * back.translation_m, kMm * back.translation_sigma_m,
               back.translation_m / back.translation_sigma_m, kMm * trial.others_moved_m);
  }
  return 0;
}

int RunMonitor(const SeedOptions& seeds) {
  if (seeds.only == "recording") return RunRecording();
  MonitorOptions options;
  options.camera_count = seeds.camera_count;
  options.duration_s = seeds.duration_s;
  options.bumps = seeds.only != "quiet";
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
  if (!options.bumps) return 0;
  PrintBump("turned 0.05 deg", trials, &MonitorTrial::turn, options.duration_s);
  PrintBump("shifted 2 mm", trials, &MonitorTrial::shift, options.duration_s);
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
