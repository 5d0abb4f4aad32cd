// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::agent {

// A camera that answered.
struct FoundCamera {
  std::string id;  // of Aravis: "Basler-21876543"
  std::string model;
  std::string serial;
  std::string address;   // IP address or USB position; empty: not known
  std::string protocol;  // "GigEVision", "USB3Vision"
  std::string vendor = {};

  // True if `device` is its id, serial number or address.
  bool IsNamed(std::string_view device) const;
};

// "Basler-21876543 (acA1300-75gc, 192.168.1.5); ..." or "none".
std::string DescribeCameras(const std::vector<FoundCamera>& cameras);

// True for four numbers with dots.
bool IsIpv4Address(std::string_view text);

// This machine's IPv4 address in the network of `address` on `network_interface`, or on any
// interface if that is empty. NOT_FOUND lists the interfaces.
absl::StatusOr<std::string> LocalAddressFor(std::string_view address,
                                            std::string_view network_interface);

// Every camera that Aravis finds. GigE Vision: by broadcast on every interface. With
// `network_interface` only on that one, without USB. Takes up to a second.
absl::StatusOr<std::vector<FoundCamera>> FindCameras(const std::string& network_interface);

// FindCameras lists Aravis' own fake camera, too, which needs no network; for the whole program.
void FindFakeCameraToo();

// Sends a discovery packet to one address. None: no answer within `limit`.
absl::StatusOr<std::optional<FoundCamera>> AskCamera(const std::string& address,
                                                     const std::string& network_interface,
                                                     std::chrono::milliseconds limit);

// A GigE Vision discovery answer, header included. INVALID_ARGUMENT: it is not one.
absl::StatusOr<FoundCamera> ParseDiscoveryAnswer(std::string_view packet);

}  // namespace rigcal::agent
