// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "common/camera/intrinsics.h"
#include "common/time/clock.h"

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

enum class SensorKind : uint8_t { kUnknown = 0, kFrame = 1, kEvent = 2 };

// What an agent says about one of its cameras, and what a session keeps of it.
struct CameraDescription {
  std::string camera;  // name within the rig
  ImageSize image_size_px;
  std::optional<Intrinsics> intrinsics;  // none: not calibrated; it can stream but not be solved
  Clock clock;
  double latency_s = 0;  // from the moment a row shows to its stamp, known beforehand
  SensorKind sensor = SensorKind::kUnknown;
  std::string source;  // for people: "csv:frame_0.csv"
  // As the camera said when it was opened; none: a source without settings. For people: no result
  // depends on it.
  std::optional<CameraSettings> settings = {};

  friend bool operator==(const CameraDescription&, const CameraDescription&) = default;

  // Every fault in one message that begins with the camera's name.
  absl::Status Validate() const;
};

}  // namespace rigcal
