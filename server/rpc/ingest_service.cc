// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/ingest_service.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/wire/grpc_status.h"
#include "common/wire/observation_wire.h"
#include "server/rpc/deliveries.h"

namespace rigcal::server {
namespace {

class RefusedStream final
    : public grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse> {
 public:
  explicit RefusedStream(const absl::Status& reason) { Finish(wire::ToGrpc(reason)); }
  void OnDone() override { delete this; }
};

}  // namespace

IngestService::IngestService(AgentStreamOptions options, SessionCoordinator* coordinator,
                             Ingest* ingest, PreviewBroker* previews, std::string server_id)
    : environment_{.options = options,
                   .coordinator = coordinator,
                   .ingest = ingest,
                   .previews = previews,
                   .server_id = std::move(server_id)} {
  environment_.tasks.Start();
}

grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse>* IngestService::Connect(
    grpc::CallbackServerContext* /*context*/) {
  if (environment_.open_streams >= environment_.options.max_streams) {
    return new RefusedStream(absl::ResourceExhaustedError(absl::StrCat(
        environment_.options.max_streams, " agent streams are open, which is the limit; try ",
        "again later, or raise limits.max_agents on the server")));
  }
  return AgentStream::Open(&environment_);
}

grpc::ServerUnaryReactor* IngestService::UploadBatch(grpc::CallbackServerContext* context,
                                                     const v1::UploadBatchRequest* request,
                                                     v1::UploadBatchResponse* response) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  absl::StatusOr<Delivery> delivery = ParseDelivery(*request, environment_.options.max_batch_rows);
  if (!delivery.ok()) {
    reactor->Finish(wire::ToGrpc(delivery.status()));
    return reactor;
  }
  // The call, and with it the response, lives until Finish; ingest always answers.
  const absl::Status status = environment_.ingest->Submit(
      *delivery,
      [reactor, response](absl::StatusOr<BatchAck> ack) {
        if (ack.ok()) *response->mutable_ack() = wire::ToProto(*ack);
        reactor->Finish(wire::ToGrpc(ack.status()));
      },
      [] {});
  if (!status.ok()) reactor->Finish(wire::ToGrpc(status));
  return reactor;
}

}  // namespace rigcal::server
