// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "common/config/event_camera_config.h"

namespace rigcal::agent {

// How a live event camera is opened and set.
struct MetavisionSourceOptions {
  std::string camera;         // name within the rig
  std::string serial;         // as the camera or its SDK tells it; empty: the only one there is
  std::string settings_path;  // TOML as ReadEventCameraConfig; empty: as the camera comes
  std::optional<EventCameraSync> sync;  // goes before what the file says
  // A primary begins this much after the capture does: cameras that follow its clock must be ready
  // before it, 0 to 60 s.
  double primary_delay_s = 1;
  std::string calibration_path;  // OpenCV YAML with intrinsics and image size; empty: none
  std::string clock_id;  // of the sensor; sensors on one sync cable share one; empty: the camera's
  double latency_s = 0;  // from the moment of an event to its stamp, -10 to 10
  bool uses_triggers = false;  // without trigger_in in the file, the main input is listened to
  int trigger_channel = -1;    // the only one that is used, 0 to 31; -1: every one
  // Before a camera that was lost is looked for again; doubled each time it is not there.
  std::chrono::milliseconds shortest_pause{200};
  std::chrono::milliseconds longest_pause{5000};

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

}  // namespace rigcal::agent
