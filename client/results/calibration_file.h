// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "rigcal/v1/calibration.pb.h"

namespace rigcal::client {

// A calibration as the export `json` holds it: the message, and the joint covariance of its
// cameras.
struct CalibrationFile {
  rigcal::v1::Calibration calibration;
  // As CalibrationResult::camera_covariance. Empty: the file has none.
  std::vector<double> camera_covariance;
  std::vector<std::string> notes = {};  // for people, about how the file was read
};

// INVALID_ARGUMENT: no JSON of a calibration; `what` names it in the message.
absl::StatusOr<CalibrationFile> ParseCalibrationJson(const std::string& what,
                                                     const std::string& json);

// The calibration.json of ours that a path names: itself, or that in the folder. Empty: another
// program's file, or none.
std::string OwnCalibrationPath(const std::string& path);

// Reads an exported calibration.json (or the folder that holds it), or a file of another program
// (calibration_import.h), which has no covariance. NOT_FOUND, INVALID_ARGUMENT.
absl::StatusOr<CalibrationFile> ReadCalibration(const std::string& path);

// As the export `json` is written, with the covariance.
std::string CalibrationText(const CalibrationFile& file);

// The result with its covariance. FAILED_PRECONDITION: it has not succeeded. INVALID_ARGUMENT names
// the field that is wrong.
absl::StatusOr<CalibrationResult> ResultOf(const CalibrationFile& file);

// Puts a changed result (poses, covariance, ...) in place of the file's own.
void SetResult(const CalibrationResult& result, CalibrationFile* file);

}  // namespace rigcal::client
