// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal::client {

// The rows of a recorded folder, as `rigcal local --data` reads it: `<camera>.csv` with lines
// `timestamp_ns;x0;y0;x1;y1;...` (csv_line.h) for each camera.
struct MarkerRows {
  std::vector<CameraRows> cameras;    // by name
  std::vector<std::string> warnings;  // rows and files that were left out, by reason
};

// Files of cameras that are not among `cameras` are left out with a warning, as are lines that
// cannot be read and those after a step back of the clock, whose offset no calibration knows.
// NOT_FOUND: no such folder. INVALID_ARGUMENT: rows of fewer than two of the cameras; files with
// different numbers of markers.
absl::StatusOr<MarkerRows> ReadMarkerRows(const std::string& folder,
                                          const std::vector<std::string>& cameras);

}  // namespace rigcal::client
