// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/camera_description.h"
#include "common/target/observation.h"

namespace rigcal::testing {

struct RecordedCamera {
  CameraDescription description;  // clock named after the camera, time base "recording"
  std::vector<Observation> observations;
};

// Reads the folder of a recorded rig, `<camera>.csv` beside `<camera>.yaml`, as the agents would
// deliver it: markers in capture order with clock epochs, one sigma of `sigma_px` each. For tests
// of the server; refuses anything malformed.
absl::StatusOr<std::vector<RecordedCamera>> LoadRecordedTracks(const std::filesystem::path& folder,
                                                               double sigma_px = 0.5);

}  // namespace rigcal::testing
