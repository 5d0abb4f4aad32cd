// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "server/solve/calibrate.h"

namespace rigcal::accuracy {

// The folder of the real recordings (tests/testing/recorded_data.h). NOT_FOUND: says where to put
// it.
absl::StatusOr<std::filesystem::path> RecordingsFolder();

// The real recording of the wand. Errors of reading it.
absl::StatusOr<server::CalibrationInput> WandRecording();

// A change of one camera's rows.
struct ClockChange {
  std::string camera;
  double shift_s = 0;   // added to every stamp: the offset becomes smaller by as much
  double rate_ppm = 0;  // its clock runs fast by this: the rate becomes smaller by as much
  bool drop_every_third = false;  // of its rows
};
// NOT_FOUND: no such camera.
absl::StatusOr<server::CalibrationInput> Change(const server::CalibrationInput& input,
                                                const ClockChange& change);

// Offset (at an instant of the camera's own clock) and rate of one camera, against the median of
// the other cameras, which does not depend on this camera. NaN for no such camera.
double OffsetAgainstOthersS(const CalibrationResult& result, const std::string& camera,
                            double camera_time_s);
double RateAgainstOthersPpm(const CalibrationResult& result, const std::string& camera);

}  // namespace rigcal::accuracy
