// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "common/camera/camera_settings.h"
#include "common/camera/intrinsics.h"
#include "common/time/clock.h"

namespace rigcal {

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
