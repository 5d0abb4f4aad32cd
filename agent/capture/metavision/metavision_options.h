// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "common/config/event_camera_config.h"
#include "common/options/option_table.h"

namespace rigcal::agent {

// How a live event camera is opened and set. Ranges: see AddOptions.
struct MetavisionSourceOptions {
  std::string camera;                   // name within the rig
  std::string serial;                   // empty: the only camera there is
  std::string settings_path;            // TOML as ReadEventCameraConfig; empty: the camera's own
  std::optional<EventCameraSync> sync;  // overrides the file
  // A primary starts this much later: cameras that follow its clock must be ready before it.
  double primary_delay_s = 1;
  std::string calibration_path;  // OpenCV YAML with intrinsics and image size; empty: none
  std::string clock_id;  // of the sensor; sensors on one sync cable share one; empty: the camera's
  double latency_s = 0;  // from an event to its timestamp
  bool uses_triggers = false;  // without trigger_in in the file, the main input is used
  int trigger_channel = -1;    // 0 to 31; -1: every one
  // Between attempts to reopen a lost camera; doubled each time.
  std::chrono::milliseconds shortest_pause{200};
  std::chrono::milliseconds longest_pause{5000};

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

void AddOptions(MetavisionSourceOptions* options, OptionTable* table);

}  // namespace rigcal::agent
