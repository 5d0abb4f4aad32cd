// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/event/event.h"
#include "agent/event/event_decoder.h"
#include "common/config/event_camera_config.h"

namespace rigcal::agent {

// What an event camera said of itself when it was opened.
struct MetavisionIdentity {
  std::string serial;     // as the camera tells it
  std::string opened_as;  // what to ask for to get this one again
  std::string model;      // integrator and sensor, for people: "Prophesee IMX636"
  SensorGeometry geometry;
  EventFormat format = EventFormat::kEvt3;
  bool halves_swapped = false;              // EVT 2.1 as an IMX636 sends it
  std::vector<std::string> trigger_inputs;  // that are listened to: "main"
};

// An open event camera, as OpenEB's and the Metavision SDK's hardware layer shows it. For one
// thread. No exception of the SDK leaves it: whatever is thrown comes back as UNAVAILABLE.
class MetavisionDevice {
 public:
  virtual ~MetavisionDevice() = default;

  virtual const MetavisionIdentity& identity() const = 0;
  // The stream begins; the sensor's clock with it.
  virtual absl::Status Start() = 0;
  // Ends the stream and what is shown by the last Read. Does nothing if there is none.
  virtual void Stop() = 0;
  // Bytes of the stream that have come since the last call, empty if there are none yet; words may
  // be cut anywhere. Valid until the next Read or Stop. UNAVAILABLE: the camera is gone.
  virtual absl::StatusOr<std::span<const uint8_t>> Read() = 0;
};

struct MetavisionRequest {
  std::string camera;  // for messages
  std::string serial;  // empty: the only one there is
  EventCameraConfig config;
  int trigger_channel = -1;  // must be one of the inputs that are listened to; -1: any
};

// Opens a camera and sets it as asked; anti-flicker, which would take the wand's light for a lamp,
// is switched off. NOT_FOUND: no such camera; lists those that are there. FAILED_PRECONDITION:
// several are there and none is named; or this agent was built without the SDK. INVALID_ARGUMENT:
// a setting that the camera does not have or not offer; says what it offers. UNAVAILABLE: the SDK
// failed. Each names the camera.
absl::StatusOr<std::unique_ptr<MetavisionDevice>> OpenMetavisionDevice(
    const MetavisionRequest& request);

// Every event camera that the SDK finds, as "integrator:plugin:serial".
absl::StatusOr<std::vector<std::string>> ListMetavisionDevices();

}  // namespace rigcal::agent
