// SPDX-License-Identifier: Apache-2.0
// Time offsets of free-running cameras, over many seeds. Cameras of 50, 60 and 120 frames per
// second with random phases, 20 us of jitter, a wand of up to 2 m/s, offsets of up to 0.5 s.
// Offsets are compared against the median clock (and with their sigmas, where the result states
// them), and against the reference camera's clock by the covariance.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/rig/statistics.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/clocks_experiment.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

struct ClocksCase {
  const char* name;
  ClocksOptions options;
};

std::vector<ClocksCase> ClocksCases(const SeedOptions& seeds) {
  ClocksOptions plain;
  plain.camera_count = seeds.camera_count;
  plain.duration_s = seeds.duration_s;
  ClocksOptions small = plain, samples = plain, rates = plain, together = plain;
  small.largest_offset_s = 0.002;
  samples.clock_samples = true;
  samples.largest_offset_s = 0;
  rates.largest_rate_ppm = 50;
  together.free_running = false;
  together.largest_offset_s = 0.002;
  return {{"together, to 2 ms", together},
          {"offsets to 2 ms", small},
          {"offsets to 0.5 s", plain},
          {"clock samples", samples},
          {"0.5 s, 50 ppm", rates}};
}

void PrintRatio(double numerator, double denominator) {
  if (denominator > 0) {
    fmt::print(" {:9.3f}", std::sqrt(numerator / denominator));
  } else {
    fmt::print(" {:>9}", "-");
  }
}

void PrintClocksCase(const ClocksCase& entry, const SeedOptions& seeds) {
  const auto trials = RunAll<ClocksTrial>(seeds.count, seeds.threads, [&](int i) {
    return RunClocksTrial(entry.options, static_cast<uint32_t>(seeds.first + i));
  });
  int failures = 0, beyond = 0, false_rates = 0;
  std::vector<double> offsets_ms, rates_ppm, stated, by_covariance, positions_m;
  Nees offset_nees, shape_nees;
  for (size_t i = 0; i < trials.size(); ++i) {
    const int seed = seeds.first + static_cast<int>(i);
    const ClocksTrial& trial = trials[i];
    if (!trial.status.ok()) {
      ++failures;
      fmt::print("seed {:4}: FAILED: {}\n", seed, trial.status.ToString());
      continue;
    }
    double worst_ms = 0;
    for (const ClockError& clock : trial.clocks) {
      offsets_ms.push_back(1e3 * std::abs(clock.offset_s));
      worst_ms = std::max(worst_ms, offsets_ms.back());
      rates_ppm.push_back(std::abs(clock.rate_ppm));
      false_rates += entry.options.largest_rate_ppm == 0 && clock.rate_ppm != 0 ? 1 : 0;
      if (clock.stated_sigma_s > 0) {
        stated.push_back(std::abs(clock.offset_s) / clock.stated_sigma_s);
      }
      if (clock.covariance_sigma_s > 0) {
        by_covariance.push_back(std::abs(clock.offset_against_reference_s) /
                                clock.covariance_sigma_s);
      }
    }
    beyond += worst_ms > 0.1 ? 1 : 0;
    positions_m.push_back(trial.position_rms_m);
    if (trial.stated) {
      offset_nees.value += trial.stated->time_offsets.value;
      offset_nees.dof += trial.stated->time_offsets.dof;
      shape_nees.value += trial.stated->shape.value;
      shape_nees.dof += trial.stated->shape.dof;
    }
    if (seeds.verbose) {
      fmt::print("seed {:4}: worst offset {:.4f} ms, positions {:.2f} mm\n", seed, worst_ms,
                 1e3 * trial.position_rms_m);
    }
  }
  fmt::print("{:17} {:5} {:6} {:9.4f} {:9.4f} {:9.4f} {:7} {:6} {:8.2f} {:8.2f} {:8.2f}",
             entry.name, seeds.count, failures, InterpolatedQuantile(offsets_ms, 0.5),
             InterpolatedQuantile(offsets_ms, 0.95), InterpolatedQuantile(offsets_ms, 1), beyond,
             false_rates, InterpolatedQuantile(rates_ppm, 1), InterpolatedQuantile(stated, 1),
             InterpolatedQuantile(by_covariance, 1));
  PrintRatio(offset_nees.value, offset_nees.dof);
  PrintRatio(shape_nees.value, shape_nees.dof);
  fmt::print(" {:8.2f}\n", positions_m.empty() ? std::nan("") : 1e3 * RootMeanSquare(positions_m));
}

int RunClocks(const SeedOptions& seeds) {
  fmt::print(
      "{} cameras of 50, 60, 120 fps, {} s, jitter 20 us, wand up to 2 m/s; nan: not computed\n",
      seeds.camera_count, seeds.duration_s);
  fmt::print(
      "                               offset error, ms              seeds  false  largest  largest "
      "error/sigma   sqrt(NEES/dof)   position\n");
  fmt::print(
      "case              seeds failed    median      95 %   largest >0.1 ms  rates  ppm err   "
      "stated "
      "covarian.   offsets     shape  rms mm\n");
  for (const ClocksCase& entry : ClocksCases(seeds)) PrintClocksCase(entry, seeds);
  return 0;
}

}  // namespace

Experiment Clocks() {
  SeedOptions defaults;
  defaults.count = 50;
  defaults.duration_s = 60;
  return SeedExperiment("clocks", "time offsets and rates of free-running cameras", defaults,
                        RunClocks);
}

}  // namespace rigcal::accuracy
