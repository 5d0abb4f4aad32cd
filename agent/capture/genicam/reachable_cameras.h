// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/genicam/aravis_discovery.h"

namespace rigcal::agent {

// A GenICam camera that is reachable, and whether it can be used.
struct ReachableCamera {
  enum class State : uint8_t { kFree, kInUse, kNoPermission, kUnknown };

  FoundCamera found;
  State state = State::kFree;
  std::string note = {};  // who uses it, or what to do; empty: nothing to say
};

// "free", "in use", "no permission", "unknown".
std::string_view NameOf(ReachableCamera::State state);

// What follows "aravis:" in a source: the serial number, or the id of a camera without one and of
// Aravis' fake camera.
std::string DeviceOf(const FoundCamera& found);

// FindCameras, by id, with those at the USB that this user may not open. Asks GigE Vision cameras
// who controls them, and takes control of none. Errors as of FindCameras. Takes up to a second, and
// half a second more for each camera that does not answer.
absl::StatusOr<std::vector<ReachableCamera>> FindReachableCameras(
    const std::string& network_interface);

}  // namespace rigcal::agent
