// SPDX-License-Identifier: Apache-2.0
#include "server/access/peer.h"

#include "absl/strings/str_cat.h"

namespace rigcal::server {

std::string Describe(const Peer& peer) {
  if (!peer.has_certificate) return "a client on this machine";
  if (peer.serial.empty()) return absl::StrCat("user '", peer.name, "' (signed in by browser)");
  return absl::StrCat(peer.IsAgent() ? "agent '" : "user '", peer.name, "' (certificate ",
                      peer.serial, ")");
}

}  // namespace rigcal::server
