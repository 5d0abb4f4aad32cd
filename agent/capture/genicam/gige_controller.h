// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "absl/status/statusor.h"

namespace rigcal::agent {

// The IPv4 address of the application that controls a GigE Vision camera; none: it is free. Reads
// two registers and does not take control. "0.0.0.0": the camera does not say who.
//   NOT_FOUND    no network of this PC has `address`
//   UNAVAILABLE  no answer within `limit`
// Source: GigE Vision 1.2, 14.3 (READREG), bootstrap registers control channel privilege (0x0a00)
// and primary application IP address (0x0a14).
absl::StatusOr<std::optional<std::string>> GigeControllerOf(const std::string& address,
                                                            const std::string& network_interface,
                                                            std::chrono::milliseconds limit);

}  // namespace rigcal::agent
