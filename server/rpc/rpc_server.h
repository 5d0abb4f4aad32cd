// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/server.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/ingest/ingest.h"
#include "server/rpc/agent_service.h"
#include "server/rpc/calibration_service.h"
#include "server/rpc/camera_service.h"
#include "server/rpc/ingest_service.h"
#include "server/rpc/session_service.h"
#include "server/rpc/status_service.h"
#include "server/rpc/watch_hub.h"
#include "server/session/agent_directory.h"
#include "server/session/calibration_runner.h"
#include "server/session/preview_broker.h"
#include "server/session/session_coordinator.h"
#include "server/store/store.h"

namespace rigcal::server {

struct RpcServerOptions {
  // HOST:PORT with a loopback host; port 0: any free one. Empty: no port, for tests that use
  // InProcessChannel.
  std::string listen_address = "127.0.0.1:7420";
  IngestServiceOptions agents;
  PreviewBrokerOptions previews;
  // Memory gRPC may hold for messages and connections, in all.
  size_t memory_limit_bytes = size_t{512} << 20;
  // Threads for calls that may block: reads of the store and previews. Watches need none.
  int max_threads = 192;
  // A connection without any traffic is asked for a sign of life after keepalive_time and closed
  // keepalive_timeout later.
  std::chrono::milliseconds keepalive_time{10'000};
  std::chrono::milliseconds keepalive_timeout{5'000};
  // How often the health service looks at ingest.
  std::chrono::milliseconds health_interval{500};
  // For the status only.
  size_t ingest_queue_limit_bytes = 0;

  absl::Status Validate() const;
};

// Parts of the server that the services speak with; all must outlive the RpcServer.
struct RpcServerParts {
  Store* store = nullptr;
  Ingest* ingest = nullptr;
  AgentDirectory* directory = nullptr;
  SessionCoordinator* coordinator = nullptr;
  CalibrationRunner* runner = nullptr;
};

// FAILED_PRECONDITION unless `listen_address` is HOST:PORT with a loopback host (127.0.0.0/8, ::1,
// localhost): without certificates nobody else may come in. INVALID_ARGUMENT: not HOST:PORT.
absl::Status CheckLoopback(const std::string& listen_address);

// Owns the gRPC server with all services, health and reflection.
class RpcServer {
 public:
  static absl::StatusOr<std::unique_ptr<RpcServer>> Create(RpcServerOptions options,
                                                           RpcServerParts parts);
  ~RpcServer();

  // Serves from here on; returns the port (0 without a listen address). UNAVAILABLE: the port is in
  // use; the message names the address and says what to do.
  absl::StatusOr<int> Start();
  // Ends agent streams and watches with UNAVAILABLE, waits for other calls at most `grace`. Ingest
  // must still run.
  void Shutdown(std::chrono::milliseconds grace);
  // Only between Start and Shutdown.
  std::shared_ptr<grpc::Channel> InProcessChannel();

 private:
  RpcServer(RpcServerOptions options, RpcServerParts parts);
  void ReportHealth();

  const RpcServerOptions options_;
  const RpcServerParts parts_;
  PreviewBroker previews_;
  WatchHub watches_;
  IngestService ingest_service_;
  AgentService agent_service_;
  CameraService camera_service_;
  SessionService session_service_;
  CalibrationService calibration_service_;
  StatusService status_service_;
  std::unique_ptr<grpc::Server> server_;

  std::mutex mutex_;
  std::condition_variable stop_;
  bool stopping_ = false;
  std::thread health_thread_;
};

}  // namespace rigcal::server
