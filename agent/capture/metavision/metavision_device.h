// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/event/event_words.h"
#include "common/config/event_camera_config.h"

namespace rigcal::agent {

// Identity of an event camera when it was opened.
struct MetavisionIdentity {
  std::string serial;     // of the camera
  std::string opened_as;  // to open the same camera again
  std::string model;      // integrator and sensor: "Prophesee IMX636"
  SensorGeometry geometry;
  EventFormat format = EventFormat::kEvt3;
  std::string format_name;                  // "EVT3"
  bool halves_swapped = false;              // EVT 2.1 as an IMX636 sends it
  std::vector<std::string> trigger_inputs;  // in use: "main"
};

// An open event camera of the hardware layer of OpenEB or the Metavision SDK. For one thread.
// Exceptions of the SDK become UNAVAILABLE.
class MetavisionDevice {
 public:
  virtual ~MetavisionDevice() = default;

  virtual const MetavisionIdentity& identity() const = 0;
  // Starts the stream and the sensor's clock.
  virtual absl::Status Start() = 0;
  // Ends the stream; bytes of the last Read are no longer valid.
  virtual void Stop() = 0;
  // Bytes since the last call, empty if there are none; words may be cut anywhere. Valid until the
  // next Read or Stop. UNAVAILABLE: the camera is gone.
  virtual absl::StatusOr<std::span<const uint8_t>> Read() = 0;
};

struct MetavisionRequest {
  std::string camera;  // for messages
  std::string serial;  // empty: the only one there is
  EventCameraConfig config;
  int trigger_channel = -1;  // must be an input in use; -1: any
};

// The event cameras that the SDK finds, as "integrator:plugin:serial"; none where this agent was
// built without it. UNAVAILABLE: the SDK failed.
absl::StatusOr<std::vector<std::string>> FindMetavisionDevices();

// Opens a camera and applies its settings. Anti-flicker would remove the wand's light and is
// switched off. NOT_FOUND: no such camera; lists the cameras found. FAILED_PRECONDITION: there are
// several and none is named, or this agent was built without the SDK. INVALID_ARGUMENT: a setting
// that the camera does not offer; lists what it offers. UNAVAILABLE: the SDK failed. Each names the
// camera.
absl::StatusOr<std::unique_ptr<MetavisionDevice>> OpenMetavisionDevice(
    const MetavisionRequest& request);

}  // namespace rigcal::agent
