// SPDX-License-Identifier: Apache-2.0
#include "common/identity/role.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal {
namespace {

constexpr std::pair<Role, std::string_view> kRoleNames[] = {{Role::kAgent, "agent"},
                                                            {Role::kOperator, "operator"},
                                                            {Role::kViewer, "viewer"},
                                                            {Role::kAdmin, "admin"}};

}  // namespace

std::string_view RoleName(Role role) {
  for (const auto& [value, name] : kRoleNames) {
    if (value == role) return name;
  }
  return "unknown";
}

std::optional<Role> RoleFromName(std::string_view name) {
  for (const auto& [value, value_name] : kRoleNames) {
    if (value_name == name) return value;
  }
  return std::nullopt;
}

std::string PeerUri(Role role, std::string_view name) {
  return absl::StrCat(role == Role::kAgent ? "rigcal://agents/" : "rigcal://users/",
                      std::string(name));
}

}  // namespace rigcal
