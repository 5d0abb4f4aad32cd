// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "common/identity/role.h"
#include "server/access/peer.h"

namespace rigcal::server {

class RoleSet {
 public:
  constexpr RoleSet(std::initializer_list<Role> roles) {
    for (const Role role : roles) bits_ |= Bit(role);
  }
  constexpr bool contains(Role role) const { return (bits_ & Bit(role)) != 0; }
  constexpr bool empty() const { return bits_ == 0; }
  // "operator or admin".
  std::string ToString() const;

 private:
  static constexpr unsigned Bit(Role role) { return 1u << static_cast<unsigned>(role); }

  unsigned bits_ = 0;
};

// Who may call one RPC.
struct AccessRule {
  std::string_view method;  // "/rigcal.v1.SessionService/StopSession"
  RoleSet roles;
  bool audited = false;  // it changes something: each call gets a line in the audit log
};

// Every RPC of every service, health and reflection included.
absl::Span<const AccessRule> AccessRules();
// Null: there is no rule, and nobody may call it.
const AccessRule* FindAccessRule(std::string_view method);

// PERMISSION_DENIED names who, with which role, may not call what, and which role could. A client
// on this machine without a certificate may call everything.
absl::Status CheckAccess(const Peer& peer, std::string_view method);

}  // namespace rigcal::server
