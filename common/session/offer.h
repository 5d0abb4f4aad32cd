// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"

namespace rigcal {

// A camera that an agent sees from its PC, whether it takes part or not.
struct OfferedCamera {
  enum class Use : uint8_t {
    kFree = 1,
    kTakesPart = 2,
    kBusy = 3,          // another program has it
    kNoPermission = 4,  // the agent's user may not open it
    kGone = 5,          // it was chosen, and is not seen any more
  };

  std::string device;  // serial number, or another name that stays; it is chosen by it
  std::string kind;    // of its source: "aravis"
  std::string vendor = {};
  std::string model = {};
  std::string address = {};  // IP address or position at the USB; empty: not known
  Use use = Use::kFree;
  std::string camera = {};  // name under which it takes part; empty: it does not
  bool configured = false;  // in the agent's file or on its command line
  std::string note = {};    // why it cannot be used, and what to do

  friend bool operator==(const OfferedCamera&, const OfferedCamera&) = default;
};

// Asks an agent to use a camera, or no longer to use it.
struct ChoiceRequest {
  uint32_t request_id = 0;            // >= 1
  std::string device = {};            // empty: drop `camera`
  std::string camera = {};            // name within the rig
  std::string calibration_yaml = {};  // text of an OpenCV YAML; empty: none, or its own
};

// The answer to a ChoiceRequest.
struct ChoiceAnswer {
  uint32_t request_id = 0;
  // NOT_FOUND: no such device or name; ALREADY_EXISTS: name or device is taken;
  // FAILED_PRECONDITION: not now, or not this one; INVALID_ARGUMENT: a value; INTERNAL: it could
  // not be done.
  absl::Status status;
};

// "free", "takes part", "busy", "no permission", "gone".
inline const char* NameOf(OfferedCamera::Use use) {
  switch (use) {
    case OfferedCamera::Use::kFree:
      return "free";
    case OfferedCamera::Use::kTakesPart:
      return "takes part";
    case OfferedCamera::Use::kBusy:
      return "busy";
    case OfferedCamera::Use::kNoPermission:
      return "no permission";
    case OfferedCamera::Use::kGone:
      return "gone";
  }
  return "?";
}

}  // namespace rigcal
