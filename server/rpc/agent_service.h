// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "rigcal/v1/agent.grpc.pb.h"
#include "server/ingest/ingest.h"
#include "server/rpc/agent_stream.h"
#include "server/rpc/serial_executor.h"
#include "server/session/session_coordinator.h"

namespace rigcal::server {

struct AgentServiceOptions {
  uint32_t max_message_bytes = 4u << 20;
  uint32_t max_batch_rows = 8192;
  // Agent streams open at a time, those without a hello yet included.
  size_t max_streams = 320;
  // A stream whose hello does not come in this time is closed.
  std::chrono::milliseconds hello_timeout{10'000};
};

// rigcal.v1.AgentService. Must outlive the server it is registered with.
class AgentService final : public v1::AgentService::CallbackService {
 public:
  AgentService(AgentServiceOptions options, SessionCoordinator* coordinator, Ingest* ingest,
               PreviewBroker* previews, std::string server_id);
  // After the server has ended every stream.
  ~AgentService() override;

  grpc::ServerBidiReactor<v1::AgentMessage, v1::ServerMessage>* Connect(
      grpc::CallbackServerContext* context) override;
  grpc::ServerUnaryReactor* UploadBatch(grpc::CallbackServerContext* context,
                                        const v1::UploadBatchRequest* request,
                                        v1::UploadBatchResponse* response) override;

 private:
  const AgentServiceOptions options_;
  SerialExecutor executor_;
  AgentStreamEnvironment environment_;
};

}  // namespace rigcal::server
