// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "common/identity/role.h"

namespace rigcal::server {

// Who is at the other end of a connection. By default somebody on this machine without a
// certificate, who may do everything.
struct Peer {
  // Or, without a serial: has signed in with a browser.
  bool has_certificate = false;
  // The rest is empty without a certificate.
  Role role = Role::kAdmin;
  std::string name = {};    // agent_id, or name of a user
  std::string uri = {};     // "rigcal://agents/NAME"
  std::string serial = {};  // of the certificate: hexadecimal, lower case, without leading zeros
  int64_t not_after_utc_s = 0;

  bool IsAgent() const { return has_certificate && role == Role::kAgent; }
  friend bool operator==(const Peer&, const Peer&) = default;
};

// "agent 'pc1' (certificate 3fa2)", or "a client on this machine".
std::string Describe(const Peer& peer);

}  // namespace rigcal::server
