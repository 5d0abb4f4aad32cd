// SPDX-License-Identifier: Apache-2.0
// Do the stated sigmas hold on real data? The real recording is cut into parts, each is calibrated
// by itself, and their differences are compared with what they state. Found in ../shared/data
// beside the project, or in RIGCAL_TEST_DATA.
#include <fmt/core.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/solve/evaluate/uncertainty.h"
#include "tests/accuracy/rig/statistics.h"
#include "tests/accuracy/solver/halves_experiment.h"
#include "tests/accuracy/solver/recording.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

struct HalvesSettings {
  double block_s = 5;
};

void PrintPart(const std::string& name, const PartsTrial& trial) {
  for (size_t i = 0; i < trial.pairs.size(); ++i) {
    const PartsDifference& pair = trial.differences[i];
    const double mm = 1e3;
    fmt::print("{:22} {}-{} {:9.2f} {:9.2f} {:10.2f} {:8.2f} {:9.3f} {:7.3f} {:9.3f} {:6.2f}\n",
               name, trial.pairs[i].first + 1, trial.pairs[i].second + 1, Mean(pair.position),
               Mean(pair.rotation), pair.intrinsics.empty() ? 0 : Mean(pair.intrinsics),
               pair.time_offset.empty() ? 0 : Mean(pair.time_offset), mm * pair.points_rms_m,
               mm * pair.points_median_m, mm * pair.predicted_rms_m,
               pair.points_rms_m / pair.predicted_rms_m);
  }
}

int RunHalves(const HalvesSettings& settings) {
  const absl::StatusOr<server::CalibrationInput> input = WandRecording();
  if (!input.ok()) {
    fmt::print(stderr, "{}\n", input.status().ToString());
    return 1;
  }
  std::vector<Eigen::Vector3d> points_m;
  Straightness straight;
  double design_effect = 0;
  server::CalibrationHooks hooks;
  hooks.solved = [&](const server::RigObservations&, const server::RigSolution& solution) {
    points_m = PlacedMarkers(solution);
    straight = MeasureStraightness(solution);
    const auto uncertainty = server::ComputeUncertainty(solution, {});
    if (uncertainty.ok()) design_effect = uncertainty->design_effect;
  };
  const server::CalibrationOutcome whole = server::Calibrate(*input, {}, hooks);
  if (!whole.result.ok()) {
    fmt::print(stderr, "{}\n", whole.result.status().ToString());
    return 1;
  }
  fmt::print("mean of (difference / stated sigma)^2, each value on its own; points in mm\n");
  fmt::print("{:22} {:3} {:>9} {:>9} {:>10} {:>8} {:>9} {:>7} {:>9} {:>6}\n", "parts", "",
             "position", "rotation", "intrinsics", "offsets", "rms", "median", "predicted",
             "ratio");
  const double block_s = settings.block_s;
  const std::vector<std::pair<std::string, PartsOptions>> ways = {
      {"halves", {2, 0}},
      {"thirds", {3, 0}},
      {fmt::format("blocks of {:g} s in turn", block_s), {2, block_s}},
  };
  int failures = 0;
  for (const auto& [name, options] : ways) {
    const auto trial = RunParts(*input, options, *whole.result, points_m);
    if (!trial.ok()) {
      ++failures;
      fmt::print("{:22} FAILED: {}\n", name, trial.status().ToString());
      continue;
    }
    PrintPart(name, *trial);
  }
  fmt::print(
      "\ndesign effect of errors in common (1: independent): {:.2f}\n"
      "middle marker off the line through the ends: {:.2f} mm rms in {} instants; correlation with "
      "the next instant {:.2f}, with the 20th {:.2f}\n",
      design_effect, 1e3 * straight.rms_m, straight.count, straight.next, straight.later);
  return failures > 0 ? 1 : 0;
}

}  // namespace

Experiment Halves() {
  return {"halves", "parts of the real recording against each other; needs test data",
          [](OptionList* options) {
            auto settings = std::make_shared<HalvesSettings>();
            options->Add("--block", &settings->block_s, 1, 30, "blocks given in turn, seconds");
            return [settings] { return RunHalves(*settings); };
          }};
}

}  // namespace rigcal::accuracy
