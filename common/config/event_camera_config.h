// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal {

// The role of an event camera on a sync cable.
enum class EventCameraSync : uint8_t { kStandalone, kPrimary, kSecondary };

// "standalone", "primary", "secondary"
const std::vector<std::pair<std::string, EventCameraSync>>& EventCameraSyncNames();
std::string EventCameraSyncName(EventCameraSync sync);

// Settings of a live event camera, from a TOML file (docs/event_cameras.md shows one): these keys
// and a table [biases]. Every key may be left out; the camera then keeps its setting. The camera
// determines which biases there are and their ranges.
struct EventCameraConfig {
  std::string format;  // EVT2, EVT21, EVT3; empty: the camera's own
  std::optional<EventCameraSync> sync;
  std::vector<std::string> trigger_in;      // "main", "aux", "loopback", each once
  std::optional<int64_t> event_rate_limit;  // events/s, 0 to 2^32 - 1
  std::map<std::string, int> biases;        // by the camera's own names, such as bias_fo
};

// NOT_FOUND: no such file. INVALID_ARGUMENT: every unknown key and every bad value at once, each
// with file and line.
absl::StatusOr<EventCameraConfig> ReadEventCameraConfig(const std::string& path);

}  // namespace rigcal
