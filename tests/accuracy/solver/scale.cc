// SPDX-License-Identifier: Apache-2.0
// The scale from a wand, a measured distance of two cameras and a bar: honest, and which of them is
// wrong.
#include <fmt/core.h>

#include <cmath>
#include <memory>
#include <vector>

#include "tests/accuracy/rig/statistics.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/scale_experiment.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

constexpr double kWrongRel = 0.01;
constexpr const char* kSourceNames[kScaleSources] = {"wand", "two cameras", "bar"};

int RunScale(const SeedOptions& seeds) {
  const ScaleSigmas sigmas;
  fmt::print(
      "{} cameras, {} s at 25 Hz, 0.3 px; wand 0.2 + 0.4 m with {:.1f} mm for each span, two "
      "cameras 4 m apart with {:.1f} mm, bar of 1 m with {:.1f} mm, waved for 10 s\n",
      seeds.camera_count, seeds.duration_s, 1e3 * sigmas.wand_span_m, 1e3 * sigmas.cameras_m,
      1e3 * sigmas.bar_m);
  const auto trials = RunAll<ScaleTrial>(seeds.count, seeds.threads, [&](int i) {
    SimulationOptions simulation;
    simulation.seed = static_cast<uint32_t>(seeds.first + i);
    simulation.camera_count = seeds.camera_count;
    simulation.duration_s = seeds.duration_s;
    return RunScaleTrial(simulation, sigmas, kWrongRel);
  });
  double squares = 0, nees = 0, stated = 0, wand = 0;
  int good = 0, false_alarms = 0, named[kScaleSources] = {}, others[kScaleSources] = {};
  double own_sigma[kScaleSources] = {};
  for (size_t i = 0; i < trials.size(); ++i) {
    const ScaleTrial& trial = trials[i];
    if (!trial.status.ok()) {
      fmt::print("seed {}: FAILED: {}\n", seeds.first + static_cast<int>(i),
                 trial.status.ToString());
      continue;
    }
    ++good;
    squares += trial.error_rel * trial.error_rel;
    nees += trial.error_rel * trial.error_rel / (trial.sigma_rel * trial.sigma_rel);
    stated += trial.sigma_rel;
    wand += trial.wand_sigma_rel;
    false_alarms += trial.false_alarm ? 1 : 0;
    for (int s = 0; s < kScaleSources; ++s) {
      named[s] += trial.named[s] ? 1 : 0;
      others[s] += trial.other_named[s] ? 1 : 0;
      own_sigma[s] += trial.own_sigma_rel[s];
    }
  }
  if (good == 0) return 1;
  const Interval honest = ChiSquareShareInterval(good, 0.99);
  fmt::print(
      "{} seeds: error {:.4f} % rms, stated {:.4f} % (by the wand alone {:.4f} %); NEES "
      "{:.3f}, {:.3f} to {:.3f} with 99 %; a good source named in {}\n",
      good, 100 * std::sqrt(squares / good), 100 * stated / good, 100 * wand / good, nees / good,
      honest.low, honest.high, false_alarms);
  fmt::print("{:12} {:>12} {:>14} {:>12}\n", "1 % wrong", "named", "other named", "own sigma %");
  for (int s = 0; s < kScaleSources; ++s) {
    fmt::print("{:12} {:5} of {:4} {:14} {:12.4f}\n", kSourceNames[s], named[s], good, others[s],
               100 * own_sigma[s] / good);
  }
  return 0;
}

}  // namespace

Experiment Scale() {
  SeedOptions defaults;
  defaults.count = 200;
  defaults.duration_s = 20;
  return SeedExperiment("scale", "the scale from three sources; which of them is wrong", defaults,
                        RunScale);
}

}  // namespace rigcal::accuracy
