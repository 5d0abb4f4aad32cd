// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::agent {

// A camera that answered.
struct FoundCamera {
  std::string id;  // as Aravis names it: "Basler-21876543"
  std::string model;
  std::string serial;
  std::string address;   // of the network, or where on the USB; empty: not known
  std::string protocol;  // "GigEVision", "USB3Vision"

  // For people: "Basler-21876543 (acA1300-75gc, 192.168.1.5)".
  std::string Description() const;
  // Whether `device` names it: its id, its serial number or its address.
  bool IsNamed(std::string_view device) const;
};

// "id (model, address); ..." or "none".
std::string DescribeCameras(const std::vector<FoundCamera>& cameras);

// Whether the text is four numbers with dots.
bool IsIpv4Address(std::string_view text);

// The IPv4 address of this machine that lies in the network of `address` on `network_interface`, or
// on any if that is empty. NOT_FOUND lists the interfaces there are.
absl::StatusOr<std::string> LocalAddressFor(std::string_view address,
                                            std::string_view network_interface);

// Every camera that Aravis finds. GigE Vision: by a broadcast, on `network_interface` alone if that
// is given (then nothing else is asked, no USB either), else on every interface. Takes up to a
// second.
absl::StatusOr<std::vector<FoundCamera>> FindCameras(const std::string& network_interface);

// Asks one address whether a GigE Vision camera is there, by one small packet that changes nothing.
// None: no answer within `limit`.
absl::StatusOr<std::optional<FoundCamera>> AskCamera(const std::string& address,
                                                     const std::string& network_interface,
                                                     std::chrono::milliseconds limit);

// What a GigE Vision camera answers to discovery, header included. INVALID_ARGUMENT: it is not
// that.
absl::StatusOr<FoundCamera> ParseDiscoveryAnswer(std::string_view packet);

}  // namespace rigcal::agent
