// SPDX-License-Identifier: Apache-2.0
// When a session may end: by the expected error of the running estimate, or by a count of views;
// and what following the advice is worth. Rigs of 6 to 12 cameras.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/solver_experiments.h"
#include "tests/accuracy/solver/until_mm_experiment.h"

namespace rigcal::accuracy {
namespace {

const double kUntilMm = std::getenv("UNTIL") ? std::atof(std::getenv("UNTIL")) : 0.5;
constexpr double kFramesPerS = 50;

UntilOptions OptionsOf(const SeedOptions& seeds, int index) {
  UntilOptions options;
  options.camera_count = 6 + (seeds.first + index) % 7;
  options.duration_s = seeds.duration_s;
  options.until_mm = kUntilMm;
  if (std::getenv("LENS")) options.lens_error = std::atof(std::getenv("LENS"));
  return options;
}

// The fewest views of the poorest camera after which at least 19 of 20 rigs are below the target.
int ViewsFor(const std::vector<UntilTrial>& trials, double until_mm) {
  for (int views = 50; views <= 20'000; views += 50) {
    int good = 0, count = 0;
    for (const UntilTrial& trial : trials) {
      const int step = trial.StepWithViews(views);
      if (step < 0) continue;
      ++count;
      const double true_mm = trial.steps[static_cast<size_t>(step)].true_mm;
      good += true_mm > 0 && true_mm < until_mm ? 1 : 0;
    }
    if (count < static_cast<int>(trials.size())) return 0;
    if (20 * good >= 19 * count) return views;
  }
  return 0;
}

std::string Step(const UntilTrial& trial, int step) {
  if (step < 0) return fmt::format("{:>7} {:>8} {:>7}", "-", "-", "-");
  const UntilStep& at = trial.steps[static_cast<size_t>(step)];
  return fmt::format("{:7.0f} {:8.2f} {:7.2f}", kFramesPerS * at.time_s, at.predicted_mm,
                     at.true_mm);
}

int RunUntil(const SeedOptions& seeds) {
  const auto random = RunAll<UntilTrial>(seeds.count, seeds.threads, [&](int i) {
    return RunUntilTrial(OptionsOf(seeds, i), static_cast<uint32_t>(seeds.first + i));
  });
  const auto guided = RunAll<UntilTrial>(seeds.count, seeds.threads, [&](int i) {
    UntilOptions options = OptionsOf(seeds, i);
    options.guided = options.stop = true;
    return RunUntilTrial(options, static_cast<uint32_t>(seeds.first + i));
  });
  const int views = ViewsFor(random, kUntilMm);
  fmt::print(
      "until {} mm in 95 % of the volume; frames of each camera (50 Hz), stated and true error in "
      "mm\n                  waving anywhere         1000 views of poorest      following advice\n"
      "seed cameras   frames   stated    true  frames   stated    true  frames   stated    true\n",
      kUntilMm);
  std::vector<double> of_thousand, of_equal, of_random, solve_s, ratios;
  int stopped = 0, below = 0, guided_stopped = 0, guided_below = 0;
  for (int i = 0; i < seeds.count; ++i) {
    const UntilTrial& trial = random[static_cast<size_t>(i)];
    const UntilTrial& told = guided[static_cast<size_t>(i)];
    if (!trial.status.ok()) fmt::print("{}: {}\n", i, trial.status.ToString());
    const int stop = trial.StopAt(kUntilMm), thousand = trial.StepWithViews(1000);
    const int equal = views > 0 ? trial.StepWithViews(views) : -1;
    const int told_stop = told.StopAt(kUntilMm);
    const auto time_s = [](const UntilTrial& of, int step) {
      return of.steps[static_cast<size_t>(step)].time_s;
    };
    if (stop >= 0) {
      ++stopped;
      below += trial.steps[static_cast<size_t>(stop)].true_mm < kUntilMm ? 1 : 0;
      if (thousand >= 0) of_thousand.push_back(time_s(trial, stop) / time_s(trial, thousand));
      if (equal >= 0) of_equal.push_back(time_s(trial, stop) / time_s(trial, equal));
    }
    if (told_stop >= 0) {
      ++guided_stopped;
      guided_below += told.steps[static_cast<size_t>(told_stop)].true_mm < kUntilMm ? 1 : 0;
      if (stop >= 0) of_random.push_back(time_s(told, told_stop) / time_s(trial, stop));
    }
    for (const UntilStep& step : trial.steps) {
      solve_s.push_back(step.solve_s);
      if (step.predicted_mm > 0 && step.agrees) ratios.push_back(step.true_mm / step.predicted_mm);
    }
    fmt::print("{:4} {:7}  {}  {}  {}\n", seeds.first + i, OptionsOf(seeds, i).camera_count,
               Step(trial, stop), Step(trial, thousand), Step(told, told_stop));
    if (!seeds.verbose) continue;
    for (const UntilStep& step : trial.steps) {
      fmt::print("   {:5.0f} s: {:5} views, stated {:7.3f} mm, true {:7.3f} mm, {} {:.2f} s\n",
                 step.time_s, step.poorest_views, step.predicted_mm, step.true_mm,
                 step.agrees ? "agrees   " : "disagrees", step.solve_s);
    }
  }
  fmt::print("\nstopped {} of {}, true error below the target in {}; following advice {}, {}\n",
             stopped, seeds.count, below, guided_stopped, guided_below);
  fmt::print("true / stated error: median {:.2f}, 95 % {:.2f}\n", InterpolatedQuantile(ratios, 0.5),
             InterpolatedQuantile(ratios, 0.95));
  fmt::print("frames, of those with 1000 views of the poorest camera: median {:.2f}\n",
             InterpolatedQuantile(of_thousand, 0.5));
  if (views > 0) {
    fmt::print(
        "frames, of those with {} views, the count after which 19 of 20 rigs are below the target: "
        "median {:.2f}\n",
        views, InterpolatedQuantile(of_equal, 0.5));
  } else {
    fmt::print("no count of views puts 19 of 20 rigs below the target in {} s\n", seeds.duration_s);
  }
  fmt::print("time with advice, of that without: median {:.2f}\n",
             InterpolatedQuantile(of_random, 0.5));
  fmt::print("CPU time of an estimate: median {:.2f} s, 95 % {:.2f} s\n",
             InterpolatedQuantile(solve_s, 0.5), InterpolatedQuantile(solve_s, 0.95));
  return 0;
}

}  // namespace

Experiment UntilMm() {
  SeedOptions defaults;
  defaults.count = 20;
  defaults.duration_s = 120;
  return SeedExperiment("until_mm", "ending a session by its expected error", defaults, RunUntil);
}

}  // namespace rigcal::accuracy
