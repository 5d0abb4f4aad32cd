// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"

namespace rigcal::agent {

// How a GenICam camera (GigE Vision or USB3 Vision) is opened and set. What is not given stays as
// the camera has it.
struct AravisSourceOptions {
  std::string camera;  // name within the rig
  // Which one: Aravis' id ("Basler-21876543"), a serial number, or an IPv4 address
  // ("192.168.1.5"). An address asks that camera alone; an id looks for it on every network
  // interface.
  std::string device;

  std::string pixel_format;          // GenICam's name; empty: the camera's own if it can be read,
                                     // else the best of those it offers
  std::optional<double> exposure_s;  // 1e-6 to 10; automatic exposure is switched off
  std::optional<double> gain_db;     // -60 to 100; automatic gain is switched off
  std::optional<double> frame_rate_hz;  // above 0, at most 100 000
  // "free": as fast as the frame rate says. "software": a picture each time the agent asks, at
  // frame_rate_hz (which must be given). Else the camera's line: "Line0".
  std::string trigger = "free";
  bool ptp = false;  // switch IEEE 1588 on and wait for it; an error where the camera has none

  int buffer_count = 32;                // pictures between the network and the detector, 3 to 1000
  int packet_size = 0;                  // bytes of a GigE packet, 0 = negotiated; 576 to 65 535
  bool packet_resend = true;            // ask again for packets that are missing
  int socket_buffer_bytes = 4'194'304;  // asked of the kernel for a GigE stream; 64 KiB to 1 GiB
  std::string network_interface;        // "eth1": take the camera there only; empty: any

  std::string calibration_path;  // OpenCV YAML with intrinsics and image size; empty: none
  bool check_image_size = true;  // refuse a camera whose pictures are not as large as that says
  double blink_hz = 500;         // of the wand: a shorter exposure is warned of; 0: no check
  double latency_s = 0;          // from the middle of the exposure to the stamp that is given

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

}  // namespace rigcal::agent
