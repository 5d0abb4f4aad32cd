// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "server/solve/calibrate.h"
#include "server/solve/derivation.h"
#include "server/solve/evaluate/rig_difference.h"

namespace rigcal::accuracy {

// A rig that is calibrated, and looked at again by a few seconds of waving after one of its cameras
// was bumped.
struct MonitorOptions {
  int camera_count = 6;
  double duration_s = 40;  // of the calibration
  double look_s = 10;      // of the look
  double turn_rad = 0.05 * M_PI / 180;
  double shift_m = 0.002;
  bool bumps = true;  // false: only the look without one
};

// What became of one bumped camera.
struct BumpOutcome {
  std::string camera;
  std::vector<std::string> moved;  // as found
  double sigmas = 0;               // of the bumped camera
  std::string problem;             // that nothing can be told; or that it was not repaired
  bool repaired = false;
  bool good = false;            // the repair's grade
  double repaired_error_m = 0;  // of its centre, against the others
  // The same of a full calibration of the bumped rig: from the rows of the repair, and from as many
  // seconds as the calibration before.
  double same_rows_error_m = 0, full_error_m = 0;
  double others_moved_m = 0;  // largest change of another camera by the repair
  double nees = 0;            // (error / sigma)^2 of its centre, mean of three coordinates
};

struct MonitorTrial {
  absl::Status status;
  std::vector<std::string> quiet_moved;  // false alarms without a bump
  std::string quiet_problem;
  BumpOutcome turn, shift;
};

// Calibration, look without a bump, and the two bumps of camera `seed` modulo their number.
MonitorTrial RunMonitorTrial(const MonitorOptions& options, uint32_t seed);

// A recording in two halves, in the second of which the rows of one camera are turned about its
// centre, in its own axes.
struct RecordingTrial {
  absl::Status status;
  std::string camera;
  std::vector<std::string> quiet_moved, moved;  // as found without the turn, and with it
  std::string quiet_problem, problem;
  server::CameraDifference found;  // of the turned camera
  bool repaired = false;
  QualityGrade grade = QualityGrade::kNotEvaluated;
  std::string repair_problem;
  server::CameraDifference back;  // of the turned camera, first half to repair
  double others_moved_m = 0;      // largest change of another camera by the repair
};
RecordingTrial RunRecordingTrial(const server::CalibrationInput& recording, size_t camera,
                                 const Eigen::Vector3d& turn_rad);

// The rows of a camera as it would see them after a turn about its centre. Rows that no ray belongs
// to stay.
void TurnRows(const Eigen::Vector3d& turn_rad, server::CameraTrack* track);

// What it asks for to repair a camera.
CalibrationOptions RepairOptions(const std::string& camera);

}  // namespace rigcal::accuracy
