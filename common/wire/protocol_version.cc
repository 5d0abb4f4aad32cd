// SPDX-License-Identifier: Apache-2.0
#include "common/wire/protocol_version.h"

#include "absl/strings/str_cat.h"

namespace rigcal::wire {

v1::ProtocolVersion OwnProtocolVersion() {
  v1::ProtocolVersion version;
  version.set_major(kProtocolMajor);
  version.set_minor(kProtocolMinor);
  return version;
}

absl::Status CheckProtocolVersion(std::string_view peer, const v1::ProtocolVersion& version) {
  const uint32_t minor = version.minor();
  const bool near = minor <= kProtocolMinor + 1 && kProtocolMinor <= minor + 1;
  if (version.major() == kProtocolMajor && near) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      absl::string_view(peer.data(), peer.size()), " speaks protocol ", version.major(), ".", minor,
      ", this side speaks ", kProtocolMajor, ".", kProtocolMinor,
      "; they work together one minor version apart: update the older of the two"));
}

}  // namespace rigcal::wire
