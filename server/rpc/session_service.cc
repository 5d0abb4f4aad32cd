// SPDX-License-Identifier: Apache-2.0
#include <functional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/observation_wire.h"
#include "common/wire/session_wire.h"
#include "common/wire/time_wire.h"
#include "rigcal/v1/session_service.grpc.pb.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/list_arguments.h"
#include "server/rpc/services.h"

namespace rigcal::server {
namespace {

constexpr FilterField kSessionFilterFields[] = {{"rig"}, {"state"}};
constexpr ListFields kSessionFields = {.filter = kSessionFilterFields};

class SessionService final
    : public v1::SessionService::WithCallbackMethod_WatchSession<v1::SessionService::Service> {
 public:
  SessionService(const RpcServerParts& parts, WatchHub* watches)
      : coordinator_(*parts.coordinator),
        directory_(*parts.directory),
        store_(*parts.store),
        watches_(*watches) {}

  grpc::Status CreateSession(grpc::ServerContext*, const v1::CreateSessionRequest* request,
                             v1::CreateSessionResponse* response) override {
    return GuardedCall("CreateSession", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(Session session, wire::FromProto(*request));
      return Describe(coordinator_.CreateSession(std::move(session)), response->mutable_session());
    });
  }

  grpc::Status StartSession(grpc::ServerContext*, const v1::StartSessionRequest* request,
                            v1::StartSessionResponse* response) override {
    return GuardedCall("StartSession", [&] {
      return Describe(coordinator_.StartSession(request->id()), response->mutable_session());
    });
  }

  grpc::Status StopSession(grpc::ServerContext*, const v1::StopSessionRequest* request,
                           v1::StopSessionResponse* response) override {
    return GuardedCall("StopSession", [&]() -> absl::Status {
      RIGCAL_RETURN_IF_ERROR(wire::CheckDuration(request->drain_timeout(), "drain_timeout"));
      return Describe(
          coordinator_.StopSession(request->id(), wire::SecondsOf(request->drain_timeout())),
          response->mutable_session());
    });
  }

  grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                          v1::GetSessionResponse* response) override {
    return GuardedCall("GetSession", [&] {
      return Describe(store_.GetSession(request->id()), response->mutable_session());
    });
  }

  grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest* request,
                            v1::ListSessionsResponse* response) override {
    return GuardedCall("ListSessions", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const ListArguments list,
                              ParseListArguments(*request, kSessionFields));
      SessionFilter filter;
      for (const ListArguments::Term& term : list.filter) {
        if (term.field == "rig") {
          filter.rig = term.value;
        } else {
          RIGCAL_ASSIGN_OR_RETURN(const auto state, ParseState<v1::Session::State>(term.value));
          filter.state = static_cast<SessionState>(state);
        }
      }
      RIGCAL_ASSIGN_OR_RETURN(const auto sessions, store_.ListSessions(filter, list.Page()));
      return FillPage(
          list, sessions,
          [this](const Session& session, v1::Session* proto) { return Describe(session, proto); },
          response->mutable_sessions(), response->mutable_next_page_token());
    });
  }

  grpc::Status DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest* request,
                             v1::DeleteSessionResponse*) override {
    return GuardedCall("DeleteSession", [&] { return coordinator_.DeleteSession(request->id()); });
  }

  grpc::ServerWriteReactor<v1::WatchSessionResponse>* WatchSession(
      grpc::CallbackServerContext*, const v1::WatchSessionRequest* request) override {
    const std::string id = request->id();
    return watches_.Open<v1::WatchSessionResponse>(
        [&](std::function<void()> wake) { return coordinator_.WatchSession(id, std::move(wake)); },
        [this, id](v1::WatchSessionResponse* response) -> absl::StatusOr<bool> {
          RIGCAL_RETURN_IF_ERROR(Describe(store_.GetSession(id), response->mutable_session()));
          return response->session().state() == v1::Session::STATE_FINISHED;
        });
  }

  grpc::Status ReadObservations(grpc::ServerContext*, const v1::ReadObservationsRequest* request,
                                grpc::ServerWriter<v1::ReadObservationsResponse>* writer) override {
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

 private:
  absl::Status Describe(const absl::StatusOr<Session>& session, v1::Session* response) const {
    RIGCAL_RETURN_IF_ERROR(session.status());
    RIGCAL_ASSIGN_OR_RETURN(const auto counts, store_.GetSessionCounts(session->id));
    *response = wire::ToProto(*session, counts, directory_.ConnectedCameraNames(session->rig));
    return absl::OkStatus();
  }

  SessionCoordinator& coordinator_;
  const AgentDirectory& directory_;
  Store& store_;
  WatchHub& watches_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeSessionService(const RpcServerParts& parts, WatchHub* watches) {
  return std::make_unique<SessionService>(parts, watches);
}

}  // namespace rigcal::server
