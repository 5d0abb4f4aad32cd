// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/triangulate/triangulate_rows.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/solver/path_comparison.h"

namespace rigcal::accuracy {

// The rig of the eWand paper (Gossard, Ziegler et al., ICRA 2024), simulated as points: four frame
// cameras of 1280x1024 px, "frame_0" to "frame_3", and two event cameras of 1280x720 px, "event_0"
// and "event_1", all triggered together; neighbours are 4 m apart.

inline constexpr int kPaperFrameCameras = 4;
inline constexpr int kPaperCameras = 6;
inline constexpr double kPaperTriggerHz = 50;
inline constexpr size_t kPaperPathMarker = 1;  // of the wand of Table II: its middle marker

// A camera that sees the waved target less often takes no part.
inline constexpr int kPaperLeastViews = 10;

enum class PaperTarget : uint8_t { kWand = 0, kCircles = 1, kChecker = 2 };

// One sigma of each coordinate of a centre, pixels.
struct PaperNoise {
  double frame_px = 0, event_px = 0;
};
// As the detection experiments measured it (docs/detection.md, docs/accuracy.md); see
// paper_recording.cc.
PaperNoise NoiseOf(PaperTarget target);

struct PaperRecordingOptions {
  uint32_t seed = 1;       // of the rig, the motion and the noise
  double duration_s = 10;  // of waving
  // Views of a board that are used; of a wand all are that the trigger gives.
  double board_rate_hz = 25;
  double path_s = 5;  // how long the marker of Table II moves
  // A board turns once about the rig's vertical in this time, so that its front points to each
  // camera in turn.
  double board_turn_s = 10;
  // It is seen by cameras to which its front points by less than this; 180: from both sides.
  double board_angle_deg = 70;
  // frame_0 is exposed so much before the others, though the trigger and its stamps say together.
  double first_camera_early_s = 0;
  bool boards_noisy_as_wand = false;
  // frame_1 is moved after the calibration, before the marker of Table II: sideways, and turned
  // about its vertical.
  double bump_m = 0, bump_rad = 0;
  // One sigma of what is drawn and added: to each span of a wand, to each coordinate of the points
  // of a board.
  double wand_sigma_m = 0, board_sigma_m = 0;
};

// Of so many frames of the trigger one shows a board.
int BoardFrameStep(const PaperRecordingOptions& options);

struct PaperRecording {
  server::CalibrationInput input;        // a target waved in front of the cameras
  std::vector<CameraRows> marker;        // one marker of another wand, on another path
  std::vector<CameraRows> exact_marker;  // the same without noise
  ReferencePath path;                    // where that marker was
  CalibrationResult true_rig;            // when the marker was recorded; without residuals
  // By camera, in how many rows it sees the target that is waved.
  std::vector<std::pair<std::string, int>> views;
};

// Rows in which the target is seen.
int ViewCount(const std::vector<Observation>& rows);

// All but input and views. INVALID_ARGUMENT: options that make no world.
absl::Status RecordPaperPath(const PaperRecordingOptions& options, PaperRecording* recording);
// Of points. INVALID_ARGUMENT: options that make no world.
absl::StatusOr<PaperRecording> RecordPaper(const PaperRecordingOptions& options,
                                           PaperTarget target);

}  // namespace rigcal::accuracy
