// SPDX-License-Identifier: Apache-2.0
#include "common/identity/role.h"

#include "absl/strings/str_cat.h"

namespace rigcal {

std::string_view RoleName(Role role) {
  switch (role) {
    case Role::kAgent:
      return "agent";
    case Role::kOperator:
      return "operator";
    case Role::kViewer:
      return "viewer";
    case Role::kAdmin:
      return "admin";
  }
  return "unknown";
}

std::optional<Role> RoleFromName(std::string_view name) {
  for (const Role role : kRoles) {
    if (RoleName(role) == name) return role;
  }
  return std::nullopt;
}

std::string PeerUri(Role role, std::string_view name) {
  return absl::StrCat(role == Role::kAgent ? "rigcal://agents/" : "rigcal://users/",
                      std::string(name));
}

}  // namespace rigcal
