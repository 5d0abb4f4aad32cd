// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/checked_identity.h"
#include "server/api/api_gateway.h"
#include "server/audit/audit_log.h"
#include "server/identity/accepted_certificates.h"
#include "server/listen/listener.h"
#include "server/rpc/call_security.h"
#include "server/rpc/ingest_service.h"
#include "server/rpc/pollers.h"
#include "server/rpc/services.h"
#include "server/session/task_queue.h"

namespace rigcal::server {

struct RpcServerOptions {
  // HOST:PORT; port 0: any free one. Empty: no port, for tests that use InProcessChannel. Others
  // than loopback (127.0.0.0/8, ::1, localhost) need an identity.
  std::string listen_address = "127.0.0.1:7420";
  // Besides the port, for the server's own user on this machine. Empty: none.
  std::filesystem::path socket_file = {};
  // The folder with ca.crt, server.crt, server.key, identities.json and denied.json. Empty: no TLS.
  std::filesystem::path identity_folder = {};
  // `address`, `socket_file` and `tls` in it are set from the members here.
  ListenerOptions listener = {};
  AgentStreamOptions agents = {};
  PreviewBrokerOptions previews = {};
  DetectorBrokerOptions detectors = {};
  CameraChoicesOptions choices = {};
  ObservationReaderOptions readers = {};
  // Memory gRPC may hold for messages and connections, in all.
  size_t memory_limit_bytes = size_t{512} << 20;
  // Threads for calls that are answered soon: reads of the store and previews. Watches and readers
  // of observations need none.
  int max_threads = 192;
  // How often the health service looks at ingest and the store.
  std::chrono::milliseconds health_interval{500};
  // For the status only.
  size_t ingest_queue_limit_bytes = 0;
};

// Owns the gRPC server with all services, health and reflection.
class RpcServer {
 public:
  RpcServer(RpcServerOptions options, const RpcServerParts& parts);
  ~RpcServer();

  // Serves from here on; returns the port (0 without a listen address).
  //   INVALID_ARGUMENT  the memory does not hold one message
  //                     the address is not HOST:PORT
  //   UNAVAILABLE       the port is in use; the message names the address and says what to do
  //   FAILED_PRECONDITION  others than this machine could reach the address, and there is no
  //                        identity, or it is damaged
  absl::StatusOr<int> Start();
  // Ends agent streams and watches with UNAVAILABLE, waits for other calls at most `grace`. Ingest
  // must still run.
  void Shutdown(std::chrono::milliseconds grace);
  // Only between Start and Shutdown.
  std::shared_ptr<grpc::Channel> InProcessChannel();
  // What GetLive answers with; for others in this process that serve it.
  LiveAnswers& live_answers() { return live_answers_; }
  // For the JSON API, between Start and Shutdown; it must not outlive this object.
  std::unique_ptr<ApiGateway> MakeApiGateway();
  // Connections to the port and the socket file.
  ConnectionStats connections() { return listener_.connections().Stats(); }

 private:
  // Again and again, until the shutdown.
  void ReportHealth();
  // Takes changed certificates, and ends the connections of revoked and expired ones.
  void FollowIdentity();
  void Accept();

  const RpcServerOptions options_;
  const RpcServerParts parts_;
  AuditLog no_audit_{""};
  AuditLog& audit_;
  // Null: no TLS.
  const absl::StatusOr<std::unique_ptr<CheckedIdentity>> identity_;
  AcceptedCertificates accepted_;
  PeerConduct conduct_;
  Listener listener_;
  CallSecurity security_;
  PreviewBroker previews_;
  DetectorBroker detectors_;
  CameraChoices choices_;
  WatchHub watches_;
  ObservationReaders readers_;
  LiveAnswers live_answers_;
  IngestService ingest_service_;
  std::vector<std::unique_ptr<grpc::Service>> services_;
  Pollers pollers_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> plain_;
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> tls_;

  bool stopping_ = false;
  bool ingest_serves_ = true;
  bool hears_ = true;
  bool store_serves_ = true;    // never again once it is false
  TaskQueue health_{"health"};  // its tasks use the members above
};

}  // namespace rigcal::server
