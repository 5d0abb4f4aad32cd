// SPDX-License-Identifier: Apache-2.0
#include "server/access/role.h"

#include "absl/strings/str_cat.h"

namespace rigcal::server {

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

std::optional<Role> ParseRole(std::string_view name) {
  for (const Role role : kRoles) {
    if (RoleName(role) == name) return role;
  }
  return std::nullopt;
}

std::string RoleSet::ToString() const {
  std::string text;
  for (const Role role : kRoles) {
    if (!contains(role)) continue;
    absl::StrAppend(&text, text.empty() ? "" : " or ", std::string(RoleName(role)));
  }
  return text.empty() ? "nobody" : text;
}

}  // namespace rigcal::server
