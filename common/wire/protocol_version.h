// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

#include "absl/status/status.h"
#include "rigcal/v1/version.pb.h"

namespace rigcal::wire {

inline constexpr uint32_t kProtocolMajor = 2;
inline constexpr uint32_t kProtocolMinor = 0;
inline constexpr std::string_view kSoftwareVersion = "0.1.0";

v1::ProtocolVersion OwnProtocolVersion();
// FAILED_PRECONDITION unless same major and at most one minor apart; names both versions. `peer`
// begins the message: "agent pc-1".
absl::Status CheckProtocolVersion(std::string_view peer, const v1::ProtocolVersion& version);

}  // namespace rigcal::wire
