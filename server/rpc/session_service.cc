// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/session_service.h"

#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/observation_wire.h"
#include "common/wire/session_wire.h"
#include "server/rpc/accepted_rows.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/page.h"
#include "server/rpc/watch_loop.h"

namespace rigcal::server {

absl::Status SessionService::Describe(absl::StatusOr<Session> session,
                                      v1::Session* response) const {
  RIGCAL_RETURN_IF_ERROR(session.status());
  RIGCAL_ASSIGN_OR_RETURN(const SessionView view, coordinator_.Describe(*std::move(session)));
  *response = wire::ToProto(view.session, view.counts, view.connected_cameras);
  return absl::OkStatus();
}

grpc::Status SessionService::CreateSession(grpc::ServerContext* /*context*/,
                                           const v1::CreateSessionRequest* request,
                                           v1::Session* response) {
  return GuardedCall("CreateSession", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(Session session, wire::FromProto(*request));
    return Describe(coordinator_.CreateSession(std::move(session)), response);
  });
}

grpc::Status SessionService::StartSession(grpc::ServerContext* /*context*/,
                                          const v1::StartSessionRequest* request,
                                          v1::Session* response) {
  return GuardedCall("StartSession",
                     [&] { return Describe(coordinator_.StartSession(request->id()), response); });
}

grpc::Status SessionService::StopSession(grpc::ServerContext* /*context*/,
                                         const v1::StopSessionRequest* request,
                                         v1::Session* response) {
  return GuardedCall("StopSession", [&] {
    return Describe(coordinator_.StopSession(request->id(), request->drain_timeout_s()), response);
  });
}

grpc::Status SessionService::GetSession(grpc::ServerContext* /*context*/,
                                        const v1::GetSessionRequest* request,
                                        v1::Session* response) {
  return GuardedCall("GetSession",
                     [&] { return Describe(store_.GetSession(request->id()), response); });
}

grpc::Status SessionService::ListSessions(grpc::ServerContext* /*context*/,
                                          const v1::ListSessionsRequest* request,
                                          v1::ListSessionsResponse* response) {
  return GuardedCall("ListSessions", [&]() -> absl::Status {
    const std::string& token = request->page_token();
    const int page_size = PageSize(request->page_size());
    // One more than asked for, to know whether there is another page.
    const auto sessions = store_.ListSessions(request->rig(), page_size + 1, token);
    if (!sessions.ok()) return PageError(sessions.status(), token);
    size_t bytes = 0;
    for (const Session& session : *sessions) {
      if (response->sessions_size() == page_size || bytes > kMaxPageBytes) {
        response->set_next_page_token(response->sessions().rbegin()->id());
        break;
      }
      v1::Session proto;
      const absl::Status status = Describe(session, &proto);
      if (absl::IsNotFound(status)) continue;  // deleted meanwhile
      RIGCAL_RETURN_IF_ERROR(status);
      bytes += proto.ByteSizeLong();
      *response->add_sessions() = std::move(proto);
    }
    return absl::OkStatus();
  });
}

grpc::Status SessionService::DeleteSession(grpc::ServerContext* /*context*/,
                                           const v1::DeleteSessionRequest* request,
                                           v1::DeleteSessionResponse* /*response*/) {
  return GuardedCall("DeleteSession", [&] { return coordinator_.DeleteSession(request->id()); });
}

grpc::Status SessionService::WatchSession(grpc::ServerContext* context,
                                          const v1::WatchSessionRequest* request,
                                          grpc::ServerWriter<v1::Session>* writer) {
  return GuardedCall("WatchSession", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(const auto watch, coordinator_.WatchSession(request->id()));
    return RunWatch(*context, watch.get(), [&]() -> absl::StatusOr<bool> {
      v1::Session session;
      RIGCAL_RETURN_IF_ERROR(Describe(store_.GetSession(request->id()), &session));
      if (!writer->Write(session)) return absl::CancelledError("the client has gone");
      return session.state() == v1::Session::FINISHED;
    });
  });
}

grpc::Status SessionService::ReadObservations(grpc::ServerContext* /*context*/,
                                              const v1::ReadObservationsRequest* request,
                                              grpc::ServerWriter<v1::ObservationBatch>* writer) {
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
        v1::ObservationBatch proto;
        wire::ToProto(batch, &proto);
        if (!writer->Write(proto)) return absl::CancelledError("the client has gone");
      }
      return absl::OkStatus();
    });
  });
}

}  // namespace rigcal::server
