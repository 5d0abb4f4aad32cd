// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/status.h"

namespace rigcal {

// How a camera was set when its agent opened it, read back from the camera. Empty and 0: not known.
struct CameraSettings {
  std::string model;         // vendor, model and serial number, for people
  std::string pixel_format;  // GenICam's name: "BayerRG8"
  double exposure_s = 0;
  double gain_db = 0;
  double frame_rate_hz = 0;
  std::string trigger;  // "free", "software", or the line: "Line0"
  bool ptp = false;     // its clock follows IEEE 1588

  friend bool operator==(const CameraSettings&, const CameraSettings&) = default;

  // INVALID_ARGUMENT with every fault: texts of more than 256 bytes or with control characters,
  // numbers that are not finite, a negative exposure or rate.
  absl::Status Validate() const;
};

}  // namespace rigcal
