// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/server_builder.h>

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/checked_identity.h"
#include "server/audit/audit_log.h"
#include "server/identity/accepted_certificates.h"
#include "server/listen/listener.h"
#include "server/rpc/call_security.h"
#include "server/rpc/pollers.h"

namespace rigcal::server {

struct RpcEndpointOptions {
  // HOST:PORT; port 0: any free one. Empty: no port, for tests that use a channel within the
  // process. Others than loopback (127.0.0.0/8, ::1, localhost) need an identity.
  std::string listen_address = "127.0.0.1:7420";
  // Besides the port, for the server's own user on this machine. Empty: none.
  std::filesystem::path socket_file = {};
  // The folder with ca.crt, server.crt, server.key, identities.json and denied.json. Empty: no TLS.
  std::filesystem::path identity_folder = {};
  // `address`, `socket_file`, `tls`, `on_stall` and `readers` in it are set here.
  ListenerOptions listener = {};
  // Memory gRPC may hold for messages and connections, in all.
  size_t memory_limit_bytes = size_t{512} << 20;
  // Threads for calls that are answered soon: reads of the store and previews. Watches and readers
  // of observations need none.
  int max_threads = 192;
};

// Where clients of gRPC reach a server: port and socket file, who may come in, and the limits of
// the transport. What is answered there is for the gRPC server that is built with it.
class RpcEndpoint {
 public:
  RpcEndpoint(RpcEndpointOptions options, AuditLog* audit);

  // Binds the port and adds the rest to `builder`. Returns the port (0 without a listen address).
  //   INVALID_ARGUMENT  the memory does not hold one message, or the address is not HOST:PORT
  //   UNAVAILABLE       the port is in use; the message names the address and says what to do
  //   FAILED_PRECONDITION  others than this machine could reach the address, and there is no
  //                        identity, or it is damaged
  absl::StatusOr<int> AddTo(grpc::ServerBuilder* builder, size_t max_message_bytes);
  // Accepts connections; once the gRPC server is started.
  void Accept();
  // Takes changed certificates, and ends the connections of revoked and expired ones.
  void FollowIdentity();
  // Accepts nothing more.
  void Stop() { listener_.Stop(); }
  // After the shutdown of the gRPC server.
  void StopPollers() { pollers_.Shutdown(); }

  CallSecurity& security() { return security_; }
  Listener& listener() { return listener_; }

 private:
  const RpcEndpointOptions options_;
  AuditLog& audit_;
  // Null: no TLS.
  const absl::StatusOr<std::unique_ptr<CheckedIdentity>> identity_;
  AcceptedCertificates accepted_;
  PeerConduct conduct_;
  Pollers pollers_;
  Listener listener_;
  CallSecurity security_;
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> plain_;
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> tls_;
};

}  // namespace rigcal::server
