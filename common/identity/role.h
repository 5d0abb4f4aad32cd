// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace rigcal {

// What a peer may do; the organizational unit (OU) of its certificate.
enum class Role : uint8_t {
  kAgent = 1,     // writes its own cameras and nothing else
  kOperator = 2,  // all but identities
  kViewer = 3,    // reads
  kAdmin = 4,     // what an operator does, and identities
};
inline constexpr Role kRoles[] = {Role::kAgent, Role::kOperator, Role::kViewer, Role::kAdmin};

// "agent", "operator", "viewer", "admin".
std::string_view RoleName(Role role);
std::optional<Role> RoleFromName(std::string_view name);

// The certificate's URI: "rigcal://agents/NAME" or, for the other roles, "rigcal://users/NAME".
std::string PeerUri(Role role, std::string_view name);
inline constexpr std::string_view kServerUri = "rigcal://server";

}  // namespace rigcal
