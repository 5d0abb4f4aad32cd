// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/session_service.h"

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/observation_wire.h"
#include "common/wire/session_wire.h"
#include "common/wire/time_wire.h"
#include "server/rpc/accepted_rows.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/list_arguments.h"

namespace rigcal::server {
namespace {

constexpr FilterField kSessionFilterFields[] = {{"rig"}, {"state"}};
constexpr ListFields kSessionFields = {.filter = kSessionFilterFields,
                                       .time_order = "create_time",
                                       .id_order = "id",
                                       .default_order = RecordOrder::kNewestFirst};

absl::StatusOr<SessionState> ParseSessionState(const std::string& name) {
  v1::Session::State state = v1::Session::STATE_UNSPECIFIED;
  if (v1::Session::State_Parse(name, &state) && state != v1::Session::STATE_UNSPECIFIED) {
    return static_cast<SessionState>(state);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("filter: state is '", name,
                   "'; it is STATE_CREATED, STATE_CAPTURING, STATE_DRAINING or STATE_FINISHED"));
}

}  // namespace

absl::Status SessionService::Describe(absl::StatusOr<Session> session,
                                      v1::Session* response) const {
  RIGCAL_RETURN_IF_ERROR(session.status());
  RIGCAL_ASSIGN_OR_RETURN(const SessionView view, coordinator_.Describe(*std::move(session)));
  *response = wire::ToProto(view.session, view.counts, view.connected_cameras);
  return absl::OkStatus();
}

grpc::Status SessionService::CreateSession(grpc::ServerContext* /*context*/,
                                           const v1::CreateSessionRequest* request,
                                           v1::CreateSessionResponse* response) {
  return GuardedCall("CreateSession", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(Session session, wire::FromProto(*request));
    return Describe(coordinator_.CreateSession(std::move(session)), response->mutable_session());
  });
}

grpc::Status SessionService::StartSession(grpc::ServerContext* /*context*/,
                                          const v1::StartSessionRequest* request,
                                          v1::StartSessionResponse* response) {
  return GuardedCall("StartSession", [&] {
    return Describe(coordinator_.StartSession(request->id()), response->mutable_session());
  });
}

grpc::Status SessionService::StopSession(grpc::ServerContext* /*context*/,
                                         const v1::StopSessionRequest* request,
                                         v1::StopSessionResponse* response) {
  return GuardedCall("StopSession", [&]() -> absl::Status {
    RIGCAL_RETURN_IF_ERROR(wire::CheckDuration(request->drain_timeout(), "drain_timeout"));
    return Describe(
        coordinator_.StopSession(request->id(), wire::SecondsOf(request->drain_timeout())),
        response->mutable_session());
  });
}

grpc::Status SessionService::GetSession(grpc::ServerContext* /*context*/,
                                        const v1::GetSessionRequest* request,
                                        v1::GetSessionResponse* response) {
  return GuardedCall("GetSession", [&] {
    return Describe(store_.GetSession(request->id()), response->mutable_session());
  });
}

grpc::Status SessionService::ListSessions(grpc::ServerContext* /*context*/,
                                          const v1::ListSessionsRequest* request,
                                          v1::ListSessionsResponse* response) {
  return GuardedCall("ListSessions", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(const ListArguments list, ParseListArguments(*request, kSessionFields));
    SessionFilter filter;
    for (const ListArguments::Term& term : list.filter) {
      if (term.field == "rig") {
        filter.rig = term.value;
      } else {
        RIGCAL_ASSIGN_OR_RETURN(filter.state, ParseSessionState(term.value));
      }
    }
    RIGCAL_ASSIGN_OR_RETURN(const auto sessions, store_.ListSessions(filter, list.Page()));
    PageFiller page(list);
    for (const Listed<Session>& listed : sessions) {
      if (page.full()) {
        response->set_next_page_token(page.NextToken());
        break;
      }
      v1::Session proto;
      const absl::Status status = Describe(listed.record, &proto);
      const bool deleted = absl::IsNotFound(status);  // meanwhile
      if (!deleted) RIGCAL_RETURN_IF_ERROR(status);
      page.Add(listed.position, deleted ? 0 : proto.ByteSizeLong());
      if (!deleted) *response->add_sessions() = std::move(proto);
    }
    return absl::OkStatus();
  });
}

grpc::Status SessionService::DeleteSession(grpc::ServerContext* /*context*/,
                                           const v1::DeleteSessionRequest* request,
                                           v1::DeleteSessionResponse* /*response*/) {
  return GuardedCall("DeleteSession", [&] { return coordinator_.DeleteSession(request->id()); });
}

grpc::ServerWriteReactor<v1::WatchSessionResponse>* SessionService::WatchSession(
    grpc::CallbackServerContext* /*context*/, const v1::WatchSessionRequest* request) {
  const std::string id = request->id();
  return watches_.Open<v1::WatchSessionResponse>(
      [&](std::function<void()> wake) { return coordinator_.WatchSession(id, std::move(wake)); },
      [this, id](v1::WatchSessionResponse* response) -> absl::StatusOr<bool> {
        RIGCAL_RETURN_IF_ERROR(Describe(store_.GetSession(id), response->mutable_session()));
        return response->session().state() == v1::Session::STATE_FINISHED;
      });
}

grpc::Status SessionService::ReadObservations(
    grpc::ServerContext* /*context*/, const v1::ReadObservationsRequest* request,
    grpc::ServerWriter<v1::ReadObservationsResponse>* writer) {
  return GuardedCall("ReadObservations", [&]() -> absl::Status {
    const std::string& id = request->session_id();
    RIGCAL_ASSIGN_OR_RETURN(const auto hold, coordinator_.HoldSessions({id}));
    RIGCAL_ASSIGN_OR_RETURN(const Session session, store_.GetSession(id));
    if (!request->camera().empty() && session.FindCamera(request->camera()) == nullptr) {
      return absl::NotFoundError(
          absl::StrCat("session '", id, "' has no camera '", request->camera(), "'"));
    }
    return store_.ReadObservations(id, request->camera(), [&](StoredBatch stored) {
      if (stored.late && !request->include_late()) return absl::OkStatus();
      for (const ObservationBatch& batch : AcceptedRows(std::move(stored))) {
        v1::ReadObservationsResponse response;
        wire::ToProto(batch, response.mutable_batch());
        if (!writer->Write(response)) return absl::CancelledError("the client has disconnected");
      }
      return absl::OkStatus();
    });
  });
}

}  // namespace rigcal::server
