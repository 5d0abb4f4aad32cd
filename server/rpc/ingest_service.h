// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "rigcal/v1/ingest_service.grpc.pb.h"
#include "server/ingest/ingest.h"
#include "server/rpc/agent_stream.h"
#include "server/rpc/serial_executor.h"
#include "server/session/session_coordinator.h"

namespace rigcal::server {

struct IngestServiceOptions {
  uint32_t max_message_bytes = 4u << 20;
  uint32_t max_batch_rows = 8192;
  // Agent streams open at a time, those without a hello yet included.
  size_t max_streams = 320;
  // A stream whose hello does not come in this time is closed.
  std::chrono::milliseconds hello_timeout{10'000};
};

// rigcal.v1.IngestService. Must outlive the server it is registered with.
class IngestService final : public v1::IngestService::CallbackService {
 public:
  IngestService(IngestServiceOptions options, SessionCoordinator* coordinator, Ingest* ingest,
                PreviewBroker* previews, std::string server_id);
  // After the server has ended every stream.
  ~IngestService() override;

  grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse>* Connect(
      grpc::CallbackServerContext* context) override;
  grpc::ServerUnaryReactor* UploadBatch(grpc::CallbackServerContext* context,
                                        const v1::UploadBatchRequest* request,
                                        v1::UploadBatchResponse* response) override;

 private:
  const IngestServiceOptions options_;
  SerialExecutor executor_;
  AgentStreamEnvironment environment_;
};

}  // namespace rigcal::server
