// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "rigcal/v1/calibration.pb.h"

namespace rigcal::client {

// Another program's calibration as one of ours: cameras with lens, pose and clock offset, without
// anything that only a solve knows. Its id is the path.
struct CalibrationImport {
  rigcal::v1::Calibration calibration;
  std::vector<std::string> notes;  // for people, about how the file was read
};

// NOT_FOUND: no such file or folder. INVALID_ARGUMENT: it cannot be read, with file and line; or it
// has no pose of a camera, which is named.
absl::StatusOr<CalibrationImport> ImportCalibration(const std::string& path);

// Whether what somebody typed names a file and not a calibration: ids have neither '/' nor '.'.
bool IsImportPath(const std::string& text);

}  // namespace rigcal::client
