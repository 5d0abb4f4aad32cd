// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "rigcal/v1/ingest_service.grpc.pb.h"
#include "server/rpc/agent_stream.h"

namespace rigcal::server {

// rigcal.v1.IngestService. Must outlive the server it is registered with.
class IngestService final : public v1::IngestService::CallbackService {
 public:
  // `registry` may be null.
  IngestService(AgentStreamOptions options, SessionCoordinator* coordinator, Ingest* ingest,
                PreviewBroker* previews, DetectorBroker* detectors, CameraChoices* choices,
                std::string server_id, CallSecurity* security, AgentRegistry* registry,
                StandbyBook* standbys, DataGeneration generation);
  // After the server has ended every stream.
  ~IngestService() override { environment_.tasks.Shutdown(); }

  grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse>* Connect(
      grpc::CallbackServerContext* context) override;
  grpc::ServerUnaryReactor* UploadBatch(grpc::CallbackServerContext* context,
                                        const v1::UploadBatchRequest* request,
                                        v1::UploadBatchResponse* response) override;

 private:
  // Whether the caller may write to the stream of a delivery.
  absl::Status CheckCaller(const Caller& caller, const v1::UploadBatchRequest& request,
                           const StreamKey& stream) const;

  AgentStreamEnvironment environment_;
};

}  // namespace rigcal::server
