// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/server.h>

#include <chrono>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/rpc/ingest_service.h"
#include "server/rpc/services.h"
#include "server/session/task_queue.h"

namespace rigcal::server {

struct RpcServerOptions {
  // HOST:PORT with a loopback host; port 0: any free one. Empty: no port, for tests that use
  // InProcessChannel.
  std::string listen_address = "127.0.0.1:7420";
  AgentStreamOptions agents = {};
  PreviewBrokerOptions previews = {};
  // Memory gRPC may hold for messages and connections, in all.
  size_t memory_limit_bytes = size_t{512} << 20;
  // Threads for calls that may block: reads of the store and previews. Watches need none.
  int max_threads = 192;
  // How often the health service looks at ingest.
  std::chrono::milliseconds health_interval{500};
  // For the status only.
  size_t ingest_queue_limit_bytes = 0;
};

// FAILED_PRECONDITION unless `listen_address` is HOST:PORT with a loopback host (127.0.0.0/8, ::1,
// localhost): without certificates nobody else may come in. INVALID_ARGUMENT: not HOST:PORT.
absl::Status CheckLoopback(const std::string& listen_address);

// Owns the gRPC server with all services, health and reflection.
class RpcServer {
 public:
  RpcServer(RpcServerOptions options, const RpcServerParts& parts);
  ~RpcServer();

  // Serves from here on; returns the port (0 without a listen address).
  //   INVALID_ARGUMENT  the memory does not hold one message
  //   UNAVAILABLE       the port is in use; the message names the address and says what to do
  // and the errors of CheckLoopback.
  absl::StatusOr<int> Start();
  // Ends agent streams and watches with UNAVAILABLE, waits for other calls at most `grace`. Ingest
  // must still run.
  void Shutdown(std::chrono::milliseconds grace);
  // Only between Start and Shutdown.
  std::shared_ptr<grpc::Channel> InProcessChannel();

 private:
  // Again and again, until the shutdown.
  void ReportHealth();

  const RpcServerOptions options_;
  const RpcServerParts parts_;
  PreviewBroker previews_;
  WatchHub watches_;
  IngestService ingest_service_;
  std::vector<std::unique_ptr<grpc::Service>> services_;
  std::unique_ptr<grpc::Server> server_;

  bool stopping_ = false;
  bool ingest_serves_ = true;
  TaskQueue health_{"health"};  // its tasks use the members above
};

}  // namespace rigcal::server
