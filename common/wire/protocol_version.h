// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "rigcal/v1/version.pb.h"

namespace rigcal::wire {

inline constexpr uint32_t kProtocolMajor = 2;
inline constexpr uint32_t kProtocolMinor = 0;
inline constexpr std::string_view kSoftwareVersion = "0.1.0";

inline v1::ProtocolVersion OwnProtocolVersion() {
  v1::ProtocolVersion version;
  version.set_major(kProtocolMajor);
  version.set_minor(kProtocolMinor);
  return version;
}

// FAILED_PRECONDITION unless same major and at most one minor apart; names both versions. `peer`
// begins the message: "agent pc-1".
inline absl::Status CheckProtocolVersion(const std::string& peer,
                                         const v1::ProtocolVersion& version) {
  const uint32_t minor = version.minor();
  const bool near = minor <= kProtocolMinor + 1 && kProtocolMinor <= minor + 1;
  if (version.major() == kProtocolMajor && near) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat(peer, " speaks protocol ", version.major(), ".", minor, ", this side speaks ",
                   kProtocolMajor, ".", kProtocolMinor,
                   "; they work together one minor version apart: update the older of the two"));
}

}  // namespace rigcal::wire
