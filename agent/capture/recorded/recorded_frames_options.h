// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/status.h"

namespace rigcal::agent {

// What sources of recorded pictures, folders and videos, are told.
struct RecordedFramesOptions {
  std::string camera;            // name within the rig
  std::string path;              // of the folder, the picture or the video
  std::string calibration_path;  // OpenCV YAML with intrinsics and image size; empty: none
  std::string timestamps_path;   // the pictures' times, see the source; empty: where it looks
  double fps = 0;                // pictures per second, 0 to 1e6: picture i is at i / fps; 0: the
                                 // recording tells its times
  double exposure_s = 0;         // of every picture, 0 to 10; 0: not known
  double speed = 1;              // times the recorded pace, > 0; kMaxSpeed: no waiting

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

}  // namespace rigcal::agent
