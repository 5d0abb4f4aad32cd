// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/offer.h"

namespace rigcal::agent {

// What an agent looks for to offer it.
struct ScanOptions {
  bool devices = true;      // GenICam cameras and event cameras at the network and the USB
  bool fake = false;        // with them, Aravis' own fake camera
  int simulated_count = 0;  // simulated cameras of one world, 0 to 64
  // Options of `sim:` for all of them: "speed=max;pixels=1".
  std::string simulated_options = {};
};

// Reads "3" or "3;speed=max;duration=20" into the last two. INVALID_ARGUMENT says what is wrong.
absl::Status ReadSimulatedOffer(const std::string& text, ScanOptions* options);

// A camera that a scan has seen.
struct SeenCamera {
  OfferedCamera offer;             // kFree, kBusy or kNoPermission
  std::string source;              // its SPEC without a name: "aravis:21876543"
  std::vector<std::string> names;  // by which a source may name it: id, serial number, address

  // `running` is how a camera that runs describes its source: "aravis:192.168.1.5".
  bool IsSource(std::string_view running) const;
};

// Every camera of `options`, each device once. Takes control of none, but libraries open cameras at
// the USB to read their names: not while one captures. Up to some seconds.
absl::StatusOr<std::vector<SeenCamera>> ScanCameras(const ScanOptions& options);

}  // namespace rigcal::agent
