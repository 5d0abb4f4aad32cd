// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "rigcal/v1/calibration.pb.h"

namespace rigcal::client {

// Another program's calibration as one of ours: cameras with lens, pose and clock offset, without
// anything that only a solve knows. Its id is the path. An exported calibration.json of ours comes
// as it is.
struct CalibrationImport {
  rigcal::v1::Calibration calibration;
  std::vector<std::string> notes;  // for people, about how the file was read
  // The cameras of the file that are not in `calibration`, each with the reason.
  std::vector<std::string> left_out = {};
  // About cameras that are in it, but may not be read as the file means them.
  std::vector<std::string> doubts = {};
  // No camera of the file has a pose: those of `calibration` have a lens alone.
  bool lenses_only = false;

  // All of them.
  std::vector<std::string> Messages() const;
};

// NOT_FOUND: no such file or folder. INVALID_ARGUMENT: it cannot be read, with file and line.
// `units`: a name of LengthUnitNames; empty: as the format has them, with a doubt where they cannot
// be metres.
absl::StatusOr<CalibrationImport> ImportCalibration(const std::string& path,
                                                    const std::string& units = "");

// INVALID_ARGUMENT: it has lenses alone, where poses are needed.
absl::Status CheckHasPoses(const std::string& path, const CalibrationImport& imported);

// Whether what somebody typed names a file and not a calibration: ids have neither '/' nor '.'.
bool IsImportPath(const std::string& text);

}  // namespace rigcal::client
