// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/socket.h>

#include <filesystem>
#include <string>

#include "absl/status/statusor.h"

namespace rigcal::server {

// HOST:PORT in parts, an IPv6 address without its brackets. INVALID_ARGUMENT: not HOST:PORT.
struct HostPort {
  std::string host;
  std::string port;
};
absl::StatusOr<HostPort> ParseHostPort(const std::string& address);

// HOST:PORT of what a user types: a host alone (an IPv6 address in brackets) gets this port.
// Anything else stays as it is, right or wrong.
std::string WithPort(const std::string& address, int port);

// Only this machine can reach it: 127.0.0.0/8, ::1, localhost. False for what is not HOST:PORT.
bool IsLoopbackAddress(const std::string& address);
bool IsLoopback(const sockaddr_storage& address);

// A listening socket that does not block. INVALID_ARGUMENT: not HOST:PORT. UNAVAILABLE: in use, or
// not an address of this machine; the message says what to do.
absl::StatusOr<int> ListenOn(const std::string& address);
// The port that a socket listens on.
int PortOf(int descriptor);

// A socket file of mode 0600, in place of an old one of that name: no other server may use it any
// more. INVALID_ARGUMENT: the path is too long for a socket. UNAVAILABLE: cannot be made.
absl::StatusOr<int> ListenOnFile(const std::filesystem::path& path);

// "127.0.0.1:4711", "[::1]:4711"; an IPv4 address inside IPv6 as IPv4. Empty: not an IP address.
std::string AddressText(const sockaddr_storage& address);
// The part of it that a limit per address counts: without the port, and of IPv6 the network (/64).
std::string AddressGroup(const sockaddr_storage& address);

}  // namespace rigcal::server
