// SPDX-License-Identifier: Apache-2.0
// The error that a calibration states of itself, and what makes it up, against the true one.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/solver_experiments.h"
#include "tests/accuracy/solver/stated_experiment.h"

namespace rigcal::accuracy {
namespace {

struct StatedCase {
  const char* name;
  StatedOptions options;
};

const StatedCase kStatedCases[] = {
    {"4 cameras 20 s", {.camera_count = 4, .duration_s = 20}},
    {"4 cameras 60 s", {.camera_count = 4, .duration_s = 60}},
    {"6 cameras 20 s", {.camera_count = 6, .duration_s = 20}},
    {"8 cameras 20 s", {.camera_count = 8, .duration_s = 20}},
    {"8 cameras 120 s", {.camera_count = 8, .duration_s = 120}},
    {"hall 12 cameras 60 s", {.camera_count = 12, .duration_s = 60, .wand_scale = 0.4}},
    {"upright wand", {.camera_count = 4, .duration_s = 20, .upright = true}},
    {"clocks together", {.camera_count = 4, .duration_s = 20, .moved_clocks = false}},
    {"refined lenses", {.camera_count = 4, .duration_s = 20, .intrinsics = Estimate::kRefined}},
    {"lenses off 0.3", {.camera_count = 4, .duration_s = 20, .lens_error = 0.3}},
    {"lenses off 1", {.camera_count = 4, .duration_s = 20, .lens_error = 1}},
    {"lenses off 1, fixed",
     {.camera_count = 4, .duration_s = 20, .lens_error = 1, .intrinsics = Estimate::kFixed}},
    {"lenses off 1, 60 s", {.camera_count = 6, .duration_s = 60, .lens_error = 1}},
};

const char* WordOf(ErrorBasis basis) {
  switch (basis) {
    case ErrorBasis::kCovariance:
      return "covariance";
    case ErrorBasis::kLenses:
      return "lenses";
    case ErrorBasis::kFolds:
      return "folds";
    case ErrorBasis::kUnknown:
      return "unknown";
  }
  return "unknown";
}

std::string Ratios(std::vector<double> values) {
  if (values.empty()) return fmt::format("{:>17}", "-");
  return fmt::format("{:5.2f} {:5.2f} {:5.2f}", InterpolatedQuantile(values, 0.5),
                     InterpolatedQuantile(values, 0.05), InterpolatedQuantile(values, 0.95));
}

void PrintTrial(int seed, const StatedTrial& trial) {
  fmt::print(
      "  seed {:3}: covariance {:7.3f}, with lenses {:7.3f}, stated {:7.3f}, true {:7.3f} mm; live "
      "{:7.3f}, true {:7.3f} mm; centres {:7.3f}, true {:7.3f} mm; {}, {}; {}\n",
      seed, trial.covariance_mm, trial.lenses_mm, trial.stated_mm, trial.true_mm, trial.live_mm,
      trial.live_true_mm, trial.centre_sigma_mm, trial.centre_true_mm, WordOf(trial.basis),
      trial.refined ? "refined" : "kept", trial.reason);
}

void PrintCase(const StatedCase& entry, const std::vector<StatedTrial>& trials) {
  std::vector<double> truth, covariance, lenses, stated, live, live_by_stated, centre;
  int good = 0, from[4] = {0, 0, 0, 0};
  for (const StatedTrial& trial : trials) {
    if (!trial.status.ok()) continue;
    truth.push_back(trial.true_mm);
    covariance.push_back(trial.covariance_mm / trial.true_mm);
    lenses.push_back(trial.lenses_mm / trial.true_mm);
    stated.push_back(trial.stated_mm / trial.true_mm);
    centre.push_back(trial.centre_sigma_mm / trial.centre_true_mm);
    good += trial.grade == QualityGrade::kGood ? 1 : 0;
    ++from[static_cast<size_t>(trial.basis)];
    if (!(trial.live_mm > 0)) continue;
    live.push_back(trial.live_mm / trial.live_true_mm);
    live_by_stated.push_back(trial.live_mm / trial.stated_mm);
  }
  if (truth.empty()) return;
  fmt::print("{:20} {:6.2f}  {}  {}  {}  {}  {}  {}  {:3}/{:<3} {}/{}/{}\n", entry.name,
             InterpolatedQuantile(truth, 0.5), Ratios(covariance), Ratios(lenses), Ratios(stated),
             Ratios(live), Ratios(live_by_stated), Ratios(centre), good, truth.size(), from[1],
             from[2], from[3]);
}

int RunStated(const SeedOptions& seeds) {
  fmt::print(
      "95 % of the waved places; ratios: median, 5 and 95 % of {} seeds. From: how many by the "
      "covariance, the lenses, the folds\n{:20} {:>6}  {:^17}  {:^17}  {:^17}  {:^17}  {:^17}  "
      "{:^17}  {:>4}    from\n{:20} {:>6}  {:>17}  {:>17}  {:>17}  {:>17}  {:>17}  {:>17}\n",
      seeds.count, "", "true", "covariance", "with lenses", "stated", "live", "live",
      "centres' sigma", "good", "case", "mm", "/ true", "/ true", "/ true", "/ true", "/ stated",
      "/ true");
  int failures = 0;
  for (const StatedCase& entry : kStatedCases) {
    if (!seeds.only.empty() && std::string(entry.name).find(seeds.only) == std::string::npos) {
      continue;
    }
    const auto trials = RunAll<StatedTrial>(seeds.count, seeds.threads, [&](int i) {
      return RunStatedTrial(entry.options, static_cast<uint32_t>(seeds.first + i));
    });
    for (size_t i = 0; i < trials.size(); ++i) {
      const int seed = seeds.first + static_cast<int>(i);
      if (!trials[i].status.ok()) {
        ++failures;
        fmt::print("  seed {:3}: FAILED: {}\n", seed, trials[i].status.ToString());
      } else if (seeds.verbose) {
        PrintTrial(seed, trials[i]);
      }
    }
    PrintCase(entry, trials);
  }
  return failures > 0 ? 1 : 0;
}

}  // namespace

Experiment Stated() {
  SeedOptions defaults;
  defaults.count = 10;
  return SeedExperiment("stated", "the error that a calibration states against the true one",
                        defaults, RunStated);
}

}  // namespace rigcal::accuracy
