// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal {

// How the clock of an event camera goes with those of others on one sync cable.
enum class EventCameraSync : uint8_t { kStandalone, kPrimary, kSecondary };

// "standalone", "primary" or "secondary"; INVALID_ARGUMENT quotes what is none of them.
absl::StatusOr<EventCameraSync> ParseEventCameraSync(std::string_view text);
std::string EventCameraSyncName(EventCameraSync sync);

// What a TOML file sets on a live event camera:
//
//   format = "EVT3"                  # asked of the camera; EVT2, EVT21, EVT3
//   sync = "standalone"              # standalone, primary, secondary
//   trigger_in = ["main"]            # inputs that are listened to: main, aux, loopback
//   event_rate_limit = 20_000_000    # events a second that the camera may send; 0: no limit
//
//   [biases]                         # by the camera's own names
//   bias_fo = 0
//
// Every key may be left out: what is not given stays as the camera has it. Which biases there are
// and what they may be is the camera's to say.
struct EventCameraConfig {
  std::string format;  // empty: the camera's own
  std::optional<EventCameraSync> sync;
  std::vector<std::string> trigger_in;      // "main", "aux", "loopback", each once
  std::optional<int64_t> event_rate_limit;  // events/s, 0 to 2^32 - 1
  std::map<std::string, int> biases;
};

// NOT_FOUND: no such file. INVALID_ARGUMENT: every unknown key and every bad value at once, each
// with file and line.
absl::StatusOr<EventCameraConfig> ReadEventCameraConfig(const std::string& path);

}  // namespace rigcal
