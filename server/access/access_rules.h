// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "server/access/peer.h"
#include "server/access/role.h"

namespace rigcal::server {

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
