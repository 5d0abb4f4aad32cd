// SPDX-License-Identifier: Apache-2.0
// The real recording, of which most rows are lost, each camera's own ones at random, beside the
// calibration of all rows. Found in ../shared/data beside the project, or in RIGCAL_TEST_DATA.
#include <fmt/core.h>

#include <algorithm>
#include <string>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/recording.h"
#include "tests/accuracy/solver/solver_experiments.h"
#include "tests/accuracy/solver/sparse_experiment.h"

namespace rigcal::accuracy {
namespace {

constexpr double kShares[] = {0.5, 0.7, 0.8, 0.9};

void PrintShare(const server::CalibrationInput& input, const CalibrationResult& whole, double share,
                const SeedOptions& seeds) {
  CalibrationOptions options;
  if (seeds.spline) options.trajectory = TrajectoryChoice::kSpline;
  if (seeds.instants) options.trajectory = TrajectoryChoice::kInterpolated;
  const auto runs = RunAll<SparseRun>(seeds.count, seeds.threads, [&](int i) {
    return RunSparse(input, whole, share, static_cast<uint32_t>(seeds.first + i), options);
  });
  static const char* const kGrades[] = {"not evaluated", "good", "usable", "bad"};
  std::vector<double> worst_mm, instants, noise_mm;
  double worst_sigmas = 0, worst_shape_sigmas = 0;
  int grades[4] = {};
  for (size_t i = 0; i < runs.size(); ++i) {
    const SparseRun& run = runs[i];
    const int seed = seeds.first + static_cast<int>(i);
    if (!run.status.ok()) {
      fmt::print("  {:2.0f} % seed {}: refused: {}\n", 100 * share, seed,
                 std::string(run.status.message()));
      continue;
    }
    worst_mm.push_back(1e3 * run.worst_m);
    instants.push_back(run.instant_count);
    noise_mm.push_back(1e3 * run.noise_sigma_m);
    worst_sigmas = std::max(worst_sigmas, run.worst_sigmas);
    worst_shape_sigmas = std::max(worst_shape_sigmas, run.worst_shape_sigmas);
    ++grades[static_cast<size_t>(run.grade)];
    if (!seeds.verbose) continue;
    fmt::print("  {:2.0f} % seed {}: {} instants, worst distance {:.2f} mm, {:.2f} sigma, {}\n",
               100 * share, seed, run.instant_count, 1e3 * run.worst_m, run.worst_sigmas,
               worst_shape_sigmas, kGrades[static_cast<size_t>(run.grade)]);
    for (const std::string& reason : run.reasons) fmt::print("    {}\n", reason);
  }
  fmt::print(
      "{:5.0f} % {:5} {:8} {:9.0f} {:10.2f} {:9.2f} {:8.2f} {:8.2f} {:9.2f} {:6} {:6} {:5}\n",
      100 * share, runs.size(), runs.size() - worst_mm.size(),
      worst_mm.empty() ? 0 : InterpolatedQuantile(instants, 0.5),
      worst_mm.empty() ? 0 : InterpolatedQuantile(worst_mm, 0.5),
      worst_mm.empty() ? 0 : InterpolatedQuantile(worst_mm, 1), worst_sigmas, worst_shape_sigmas,
      worst_mm.empty() ? 0 : InterpolatedQuantile(noise_mm, 0.5), grades[1], grades[2], grades[3]);
}

int RunSparses(const SeedOptions& seeds) {
  const absl::StatusOr<server::CalibrationInput> input = WandRecording();
  if (!input.ok()) {
    fmt::print(stderr, "{}\n", input.status().ToString());
    return 1;
  }
  const server::CalibrationOutcome whole = server::Calibrate(*input, {});
  if (!whole.result.ok()) {
    fmt::print(stderr, "{}\n", whole.result.status().ToString());
    return 1;
  }
  fmt::print("largest difference of a distance between two cameras from the run of all rows\n");
  fmt::print(
      "dropped draws  refused  instants  median mm  worst mm    sigma    shape  noise mm   good "
      "usable   "
      "bad\n");
  for (const double share : kShares) PrintShare(*input, *whole.result, share, seeds);
  return 0;
}

}  // namespace

Experiment Sparse() {
  SeedOptions defaults;
  defaults.count = 10;
  return SeedExperiment("sparse", "the real recording with most rows lost; needs test data",
                        defaults, RunSparses);
}

}  // namespace rigcal::accuracy
