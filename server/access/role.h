// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

namespace rigcal::server {

// What a certificate allows its owner to do; the OU of its subject.
enum class Role : uint8_t {
  kAgent,     // writes its own cameras, and nothing else
  kOperator,  // everything but identities
  kViewer,    // reads
  kAdmin,     // what an operator does, and identities
};

inline constexpr Role kRoles[] = {Role::kAgent, Role::kOperator, Role::kViewer, Role::kAdmin};

// "agent", "operator", "viewer", "admin".
std::string_view RoleName(Role role);
std::optional<Role> ParseRole(std::string_view name);

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

}  // namespace rigcal::server
