// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/target/target.h"
#include "tests/accuracy/paper/paper_recording.h"
#include "tests/accuracy/solver/path_comparison.h"

namespace rigcal::accuracy {

// How a rig is calibrated: a row of the tables.
enum class PaperMethod : uint8_t {
  kWandIndexPaired = 0,  // as the paper solves it: index_paired_solve.h
  kWand = 1,             // server::Calibrate with its defaults
  kCircles = 2,          // server::Calibrate with a board whose points are held as given
  kChecker = 3,
  kCirclesSpline = 4,  // spline_solve.h: a stand-in for kalibr
  kCheckerSpline = 5,
  kTruth = 6,  // no calibration: the simulated rig itself; what the marker's own noise leaves
};
inline constexpr int kPaperMethods = 7;
const char* NameOf(PaperMethod method);

// What is the matter with a rig.
struct PaperCondition {
  const char* name;
  double first_camera_early_s = 0;
  double bump_m = 0, bump_deg = 0;
  bool boards_noisy_as_wand = false;  // points only; only boards differ from the first condition
  double wand_sigma_m = 0, board_sigma_m = 0;
};
inline constexpr PaperCondition kPaperConditions[] = {
    {.name = "together"},
    {.name = "boards noisy as the wand", .boards_noisy_as_wand = true},
    {.name = "targets as built", .wand_sigma_m = 0.0001, .board_sigma_m = kBoardSigmaM},
    {.name = "frame_0 8 ms early", .first_camera_early_s = 0.008},
    {.name = "frame_1 bumped later", .bump_m = 0.005, .bump_deg = 0.3},
};

struct PaperOptions {
  PaperRecordingOptions recording;  // its seed is not looked at
  bool points = false;              // else pictures and events are rendered, and detected
  int seeds = 1;
  int first_seed = 1;
  int threads = 2;
  std::string only;  // rows with this in "CONDITION: METHOD"; empty: all
};

// Sums over the seeds of what one figure of a table is the mean and standard deviation of.
struct PaperSums {
  double count = 0, sum = 0, squares = 0;

  void Add(double mean, double rms, double added_count);
  void Add(const PathErrors& errors);
  double Mean() const { return sum / count; }
  double StandardDeviation() const;
};

struct PaperCamera {
  std::string camera;
  int views = 0;       // in which it sees the target, all seeds
  PaperSums error_px;  // distance of measured from projected centres, nothing left out
};

// The first seconds of a wave alone.
struct PaperShorterWave {
  double waved_s = 0;
  PaperSums exact_path_m;
  int solved = 0;  // seeds
};

// One method under one condition, over all seeds.
struct PaperRow {
  std::string condition;
  PaperMethod method = PaperMethod::kWand;
  // Table I: by name; empty where it has no row. A camera that sees the target too seldom has no
  // errors.
  std::vector<PaperCamera> cameras;
  PaperSums path_m;  // Table II: distances of one marker from its path
  // The same where its centres have no noise; where pictures are rendered, of frame cameras alone.
  PaperSums exact_path_m;
  // exact_path_m of shorter waves, under the first condition: the last one is all of it.
  std::vector<PaperShorterWave> course;
  double waved_s = 0;   // of each seed
  double instants = 0;  // mean over the seeds that were solved
  int solved = 0;       // seeds
  absl::Status first_failure;
};

// Shares of a wave that PaperRow::course has.
inline constexpr double kPaperShares[] = {0.125, 0.25, 0.375, 0.5, 0.75, 1};
// Seconds of waving from which on the error of the calibration stays within 1.2 of that of the
// whole wave; none where there is no course.
std::optional<double> EnoughWavingS(const PaperRow& row);

// "CONDITION: METHOD", what `only` looks into.
std::string NameOf(const PaperRow& row);

// Simulates and solves every row; the same for any number of threads.
std::vector<PaperRow> RunPaper(const PaperOptions& options);

// Distances of a triangulated marker from its path after a rigid motion and a time offset: the
// paper's protocol for its Table II. The calibration's own clocks, all centres alike, nothing left
// out.
absl::StatusOr<PathErrors> ComparePathOf(const CalibrationResult& calibration,
                                         const std::vector<CameraRows>& marker,
                                         const ReferencePath& path);

}  // namespace rigcal::accuracy
