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
#include "server/api/api_gateway.h"
#include "server/audit/audit_log.h"
#include "server/rpc/ingest_service.h"
#include "server/rpc/rpc_endpoint.h"
#include "server/rpc/services.h"
#include "server/session/task_queue.h"

namespace rigcal::server {

struct RpcServerOptions {
  RpcEndpointOptions endpoint = {};
  AgentStreamOptions agents = {};
  PreviewBrokerOptions previews = {};
  DetectorBrokerOptions detectors = {};
  CameraChoicesOptions choices = {};
  ObservationReaderOptions readers = {};
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

  // Serves from here on; returns the port. The port and errors of RpcEndpoint::AddTo.
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
  ConnectionStats connections() { return endpoint_.listener().connections().Stats(); }

 private:
  // Again and again, until the shutdown.
  void ReportHealth();

  const RpcServerOptions options_;
  const RpcServerParts parts_;
  AuditLog no_audit_{""};
  AuditLog& audit_;
  RpcEndpoint endpoint_;
  PreviewBroker previews_;
  DetectorBroker detectors_;
  CameraChoices choices_;
  WatchHub watches_;
  ObservationReaders readers_;
  LiveAnswers live_answers_;
  IngestService ingest_service_;
  std::vector<std::unique_ptr<grpc::Service>> services_;
  std::unique_ptr<grpc::Server> server_;

  bool stopping_ = false;
  bool ingest_serves_ = true;
  bool hears_ = true;
  bool store_serves_ = true;    // never again once it is false
  TaskQueue health_{"health"};  // its tasks use the members above
};

}  // namespace rigcal::server
