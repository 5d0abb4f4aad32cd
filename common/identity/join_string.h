// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/identity/role.h"

namespace rigcal {

inline constexpr size_t kJoinSecretBytes = 16;
inline constexpr size_t kMaxJoinHosts = 16;

// All that a PC needs to join a server, as one string that is copied by hand:
// "rk1.", then in base64url (RFC 4648, without padding)
//   1 byte    role
//   8 bytes   expiry, seconds since 1970, big endian
//   32 bytes  SHA-256 of the CA's certificate (DER)
//   16 bytes  secret
//   text      name that the certificate will have; empty: the one who joins chooses
//   2 bytes   gRPC port; 2 bytes HTTPS port
//   1 byte    number of hosts; each a text
//   4 bytes   CRC-32 of all bytes before, to tell a typo from a wrong string
// where a text is its length in one byte, and its bytes.
struct JoinString {
  Role role = Role::kAgent;
  absl::Time expiry;      // whole seconds
  std::string ca_sha256;  // 32 bytes
  std::string secret;     // kJoinSecretBytes
  std::string name;       // as ValidateName, or empty
  uint16_t grpc_port = 7420;
  uint16_t https_port = 7421;
  std::vector<std::string> hosts;  // DNS names and IP addresses, 1 to kMaxJoinHosts

  friend bool operator==(const JoinString&, const JoinString&) = default;
};

// The fields must be as described above.
std::string FormatJoinString(const JoinString& join);

// INVALID_ARGUMENT: it is none, is made by a newer version, has a typo, or a field holds what it
// must not. Space around it is ignored. The message never quotes the string, which is a secret.
absl::StatusOr<JoinString> ParseJoinString(std::string_view text);

// Letters, digits, '.', '-' and ':' only, as in DNS names and IP addresses.
bool IsHostText(std::string_view host);
// "host:port", an IPv6 address in brackets.
std::string JoinHostPort(std::string_view host, uint16_t port);
// Of all hosts.
std::vector<std::string> HostPorts(const std::vector<std::string>& hosts, uint16_t port);
// Takes HOST:PORT apart, without the brackets. False: it is none.
bool SplitHostPort(std::string_view address, std::string* host, uint16_t* port);

}  // namespace rigcal
