// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "common/options/option_table.h"

namespace rigcal::agent {

// How a GenICam camera (GigE Vision or USB3 Vision) is opened and set. Options not given keep the
// camera's present setting. Ranges: see AddOptions.
struct AravisSourceOptions {
  std::string camera;  // name within the rig
  // Aravis' id ("Basler-21876543"), a serial number, or an IPv4 address ("192.168.1.5"). An address
  // asks that camera alone; an id is searched on every network interface.
  std::string device;

  std::string pixel_format;          // GenICam's name; empty: the camera's own if it can be read,
                                     // else the best of those it offers
  std::optional<double> exposure_s;  // switches automatic exposure off
  std::optional<double> gain_db;     // switches automatic gain off
  std::optional<double> frame_rate_hz;
  // "free": at the camera's frame rate. "software": the agent requests each frame, at frame_rate_hz
  // (which must be given). Else the camera's line: "Line0".
  std::string trigger = "free";
  bool ptp = false;  // switch IEEE 1588 on and wait for it; an error if the camera has none

  int buffer_count = 32;                // frames between the network and the detector
  int packet_size = 0;                  // bytes of a GigE packet, 576 or more; 0: negotiated
  bool packet_resend = true;            // ask again for packets that are missing
  int socket_buffer_bytes = 4'194'304;  // of the kernel, for a GigE stream
  std::string network_interface;        // "eth1": take the camera there only; empty: any

  std::string calibration_path;  // OpenCV YAML with intrinsics and image size; empty: none
  double latency_s = 0;          // from the middle of the exposure to the timestamp

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

void AddOptions(AravisSourceOptions* options, OptionTable* table);

}  // namespace rigcal::agent
