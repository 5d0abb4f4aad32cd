// SPDX-License-Identifier: Apache-2.0
// What a detection's confidence says: for each least confidence (option min_confidence) how many
// frames without a wand show a false one, how many with one, and how many wands are found, in all
// rooms of `detection` together. A seed is a room of each kind.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/accuracy/detection/detection_experiment.h"
#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/detection/photographs.h"
#include "tests/accuracy/detection/room_cases.h"
#include "tests/accuracy/seed_options.h"

namespace rigcal::accuracy {
namespace {

constexpr double kLeastConfidences[] = {0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98};

// Upper end of a rate of which `count` of `all` were seen, with 95 % (a Poisson count: 3 where none
// was seen, after Wilson and Hilferty's approximation of chi-squared else).
double UpperRate(int count, int all) {
  if (all == 0) return 1;
  const double n = count + 1;
  const double limit =
      count == 0 ? -std::log(0.05) : n * std::pow(1 - 1 / (9 * n) + 1.645 / (3 * std::sqrt(n)), 3);
  return std::min(1.0, limit / all);
}

DetectionSummary Sum(const std::vector<DetectionCase>& rooms, const SeedOptions& seeds,
                     double least_confidence) {
  DetectionSummary sum;
  for (const DetectionCase& room : rooms) {
    if (!seeds.only.empty() && room.name.find(seeds.only) == std::string::npos) continue;
    DetectionOptions options = PaperDetection();
    options.frames = options.frames_per_room * seeds.count;
    options.seed = static_cast<uint32_t>(seeds.first);
    options.threads = seeds.threads;
    options.detector.min_confidence = least_confidence;
    room.change(&options);
    const DetectionSummary one = Summarise(RunDetection(options));
    sum.frames += one.frames;
    sum.empty_frames += one.empty_frames;
    sum.false_in_empty += one.false_in_empty;
    sum.false_wands += one.false_wands;
    sum.shown += one.shown;
    sum.found += one.found;
  }
  return sum;
}

int RunDetectionScore(const SeedOptions& seeds) {
  const std::vector<DetectionCase> rooms = RoomCases(FindPhotographs());
  fmt::print(
      "                false wands in frames            95 %: at most, %     wands found\n"
      "min_confidence   without      with one      without   with one      %   of\n");
  for (const double least : kLeastConfidences) {
    const DetectionSummary sum = Sum(rooms, seeds, least);
    const int with_wand = sum.frames - sum.empty_frames;
    const int false_in_shown = sum.false_wands - sum.false_in_empty;
    fmt::print("{:14.2f} {:4} of {:5} {:4} of {:5} {:10.2f} {:10.2f} {:6.1f} {:5}\n", least,
               sum.false_in_empty, sum.empty_frames, false_in_shown, with_wand,
               100 * UpperRate(sum.false_in_empty, sum.empty_frames),
               100 * UpperRate(false_in_shown, with_wand),
               sum.shown > 0 ? 100.0 * sum.found / sum.shown : 0.0, sum.shown);
  }
  return 0;
}

}  // namespace

Experiment DetectionScore() {
  SeedOptions defaults;
  defaults.count = 8;
  return SeedExperiment("detection_score", "false wands and found ones by least confidence",
                        defaults, RunDetectionScore);
}

}  // namespace rigcal::accuracy
