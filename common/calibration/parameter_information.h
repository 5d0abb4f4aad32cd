// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace rigcal {

// A part of the observations of a calibration.
struct InformationGroup {
  enum class Kind : uint8_t { kSession = 1, kSpan = 2, kCamera = 3 };
  Kind kind = Kind::kSession;
  std::string session_id;       // of a session or span
  double from_s = 0, to_s = 0;  // of a span, since the first instant of its session
  std::string camera;
  uint32_t instant_count = 0;
};

// What the groups say about one number of one camera.
struct ParameterInformation {
  enum class Kind : uint8_t { kPosition = 1, kRotation = 2, kTimeOffset = 3, kIntrinsic = 4 };
  std::string camera;
  Kind kind = Kind::kPosition;
  std::string name;  // "x", "offset", "fx"
  double sigma = 0;  // with all data
  // By group: 1 - (variance with it) / (variance without it); -1: the camera's own.
  std::vector<float> share;
};

// rigcal/v1/information.proto
struct CalibrationInformation {
  std::vector<InformationGroup> groups;
  std::vector<ParameterInformation> parameters;
  std::string calibration_id;  // whose solve and axes; empty: those of the calibration itself
  uint32_t stride = 1;         // of the instants that were looked at
};

}  // namespace rigcal
