// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/security/credentials.h>

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace rigcal::wire {

// How a client of the gRPC port reaches a server.

// The files that joining a server leaves on a PC. Nothing needs to exist.
struct ClientIdentity {
  std::filesystem::path folder;  // with ca.crt and servers.json; empty: this PC has joined nothing
  std::string stem;              // of the certificate and its key: "agent" for agent.crt, agent.key

  static ClientIdentity OfAgent(const std::filesystem::path& state_dir) {
    return {state_dir / "identity", "agent"};
  }
  // In $XDG_CONFIG_HOME/rigcal, else ~/.config/rigcal.
  static ClientIdentity OfUser();
  bool Exists() const;
};

// "unix:/PATH", or HOST:PORT with the host 127.0.0.0/8, ::1 or localhost.
bool IsOnThisMachine(std::string_view address);

// The server to ask where none is named: the first that this PC has joined; else the socket file of
// a server of this user that answers, in the user's own data folder or in that of the service; else
// 127.0.0.1:7420.
std::string DefaultServerAddress(const ClientIdentity& identity);

// None for a server on this machine that was not joined. For others mutual TLS with the files of
// `identity`, as they are now; the server's certificate must name the host in `address`.
// FAILED_PRECONDITION: they are missing or damaged; the message says what to do. UNAVAILABLE: they
// are missing, and the name in `address` is of no PC.
absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> CredentialsFor(
    const std::string& address, const ClientIdentity& identity);

}  // namespace rigcal::wire
