// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/ingest_service.h"

#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/grpc_status.h"
#include "common/wire/observation_wire.h"
#include "common/wire/request_traits.h"
#include "server/rpc/correlated_call.h"
#include "server/rpc/deliveries.h"

namespace rigcal::server {
IngestService::IngestService(AgentStreamOptions options, SessionCoordinator* coordinator,
                             Ingest* ingest, PreviewBroker* previews, DetectorBroker* detectors,
                             CameraChoices* choices, std::string server_id, CallSecurity* security,
                             AgentRegistry* registry, StandbyBook* standbys,
                             DataGeneration generation)
    : environment_{.options = options,
                   .coordinator = coordinator,
                   .ingest = ingest,
                   .previews = previews,
                   .detectors = detectors,
                   .choices = choices,
                   .server_id = std::move(server_id),
                   .security = security,
                   .registry = registry,
                   .standbys = standbys,
                   .generation = std::move(generation)} {
  environment_.tasks.Start();
}

grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse>* IngestService::Connect(
    grpc::CallbackServerContext* context) {
  return AgentStream::Open(&environment_, environment_.security->CallerOf(*context),
                           CorrelationOf(*context));
}

absl::Status IngestService::CheckCaller(const Caller& caller, const v1::UploadBatchRequest& request,
                                        const StreamKey& stream) const {
  std::string agent_id = request.agent_id();
  if (caller.peer.has_certificate) {
    if (caller.peer.name.empty()) {
      return absl::UnauthenticatedError("the caller's certificate counts no more");
    }
    const std::string& own = caller.peer.IsAgent() ? caller.peer.name : "";
    if (!agent_id.empty() && agent_id != own) {
      return absl::PermissionDeniedError(
          absl::StrCat(Describe(caller.peer), " must not deliver as agent '",
                       absl::CHexEscape(agent_id.substr(0, 64)), "'"));
    }
    agent_id = own;
  } else if (!agent_id.empty() && environment_.registry != nullptr) {
    RIGCAL_RETURN_IF_ERROR(environment_.registry->CheckInstallation(
        agent_id, CredentialOf(request.installation_secret()), "of an upload"));
  }
  return environment_.coordinator->contexts().CheckAgent(stream, agent_id, /*rig=*/"");
}

grpc::ServerUnaryReactor* IngestService::UploadBatch(grpc::CallbackServerContext* context,
                                                     const v1::UploadBatchRequest* request,
                                                     v1::UploadBatchResponse* response) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const Caller caller = environment_.security->CallerOf(*context);
  environment_.security->NoteMessage(caller, request->ByteSizeLong() + kCallHeaderBytes);
  // What is left of the call is in nobody's power but ours: ingest always answers.
  environment_.security->EndCall(caller);
  absl::StatusOr<Delivery> delivery = ParseDelivery(*request, environment_.options.max_batch_rows);
  if (const absl::Status fault = wire::FaultOf(*request); !fault.ok()) delivery = fault;
  if (!delivery.ok()) {
    reactor->Finish(wire::ToGrpc(delivery.status()));
    return reactor;
  }
  if (const absl::Status status = CheckCaller(caller, *request, delivery->stream()); !status.ok()) {
    environment_.AuditRefusal(caller, request->agent_id(), status);
    reactor->Finish(wire::ToGrpc(status));
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
