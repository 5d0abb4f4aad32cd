// SPDX-License-Identifier: Apache-2.0
// The floor as z = 0 from a wand that lies on it at two or three places.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/accuracy/rig/statistics.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/origin_experiment.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

constexpr double kAllowedHeightM = 1e-3;
constexpr double kAllowedTiltDeg = 0.03;
constexpr int kTransformDof = 6;

double ShareOf(std::vector<double> values, double share) {
  std::ranges::sort(values);
  return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1))];
}

int RunOrigin(const SeedOptions& seeds) {
  fmt::print(
      "{} cameras 4 m from the middle of the floor, {} s at 25 Hz, 0.3 px; the wand on the floor "
      "for 1 s at each place; floor of 4 m by 4 m\n",
      seeds.camera_count, seeds.duration_s);
  fmt::print("{:>6} {:>5} {:>6} {:>20} {:>26} {:>12} {:>24}\n", "", "", "", "largest height, mm",
             "tilt, degrees", "within both", "NEES of the transform");
  fmt::print("{:>6} {:>5} {:>6} {:>9} {:>10} {:>8} {:>8} {:>8} {:>12} {:>8} {:>15}\n", "places",
             "seeds", "failed", "median", "95 %", "median", "95 %", "stated", "1 mm, 0.03",
             "mean/6", "99 % of it");
  for (const int places : {2, 3}) {
    const auto trials = RunAll<OriginTrial>(seeds.count, seeds.threads, [&](int i) {
      SimulationOptions simulation;
      simulation.seed = static_cast<uint32_t>(seeds.first + i);
      simulation.camera_count = seeds.camera_count;
      simulation.duration_s = seeds.duration_s;
      return RunOriginTrial(simulation, places);
    });
    std::vector<double> heights_m, tilts_deg, stated_deg;
    double nees = 0;
    int within = 0;
    for (size_t i = 0; i < trials.size(); ++i) {
      const OriginTrial& trial = trials[i];
      if (!trial.status.ok()) {
        fmt::print("seed {}: FAILED: {}\n", seeds.first + static_cast<int>(i),
                   trial.status.ToString());
        continue;
      }
      if (seeds.verbose) {
        fmt::print("seed {:4}: {} places, {:.3f} mm, {:.4f} deg (stated {:.4f}), NEES {:.1f}\n",
                   seeds.first + static_cast<int>(i), trial.place_count, 1e3 * trial.height_m,
                   trial.tilt_deg, trial.stated_tilt_deg, trial.nees);
      }
      heights_m.push_back(trial.height_m);
      tilts_deg.push_back(trial.tilt_deg);
      stated_deg.push_back(trial.stated_tilt_deg);
      nees += trial.nees;
      const bool good = trial.height_m <= kAllowedHeightM && trial.tilt_deg <= kAllowedTiltDeg;
      within += good ? 1 : 0;
    }
    if (heights_m.empty()) continue;
    const auto count = static_cast<int>(heights_m.size());
    const Interval honest = ChiSquareShareInterval(kTransformDof * count, 0.99);
    fmt::print(
        "{:6} {:5} {:6} {:9.3f} {:10.3f} {:8.4f} {:8.4f} {:8.4f} {:5} of {:3} {:8.3f} {:7.3f} to "
        "{:.3f}\n",
        places, count, seeds.count - count, 1e3 * ShareOf(heights_m, 0.5),
        1e3 * ShareOf(heights_m, 0.95), ShareOf(tilts_deg, 0.5), ShareOf(tilts_deg, 0.95),
        ShareOf(stated_deg, 0.5), within, count, nees / count / kTransformDof, honest.low,
        honest.high);
  }
  return 0;
}

}  // namespace

Experiment Origin() {
  SeedOptions defaults;
  return SeedExperiment("origin", "the floor from a wand that lies on it: height, tilt, honesty",
                        defaults, RunOrigin);
}

}  // namespace rigcal::accuracy
