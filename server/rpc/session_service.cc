// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <functional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/request_traits.h"
#include "common/wire/session_wire.h"
#include "common/wire/spool_wire.h"
#include "common/wire/time_wire.h"
#include "rigcal/v1/session_service.grpc.pb.h"
#include "server/rpc/answer_limits.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/correlated_call.h"
#include "server/rpc/list_arguments.h"
#include "server/rpc/services.h"
#include "server/session/prune.h"

namespace rigcal::server {
namespace {

// Clients accept 4 MiB.
constexpr size_t kMaxAuditedBytes = (size_t{4} << 20) - (64 << 10);
constexpr int64_t kMaxAgeS = int64_t{100} * 366 * 86400;
constexpr FilterField kSessionFilterFields[] = {{"rig"}, {"state"}};
constexpr ListFields kSessionFields = {.filter = kSessionFilterFields};

// Each reads a whole session on a thread of the calls.
constexpr int kMaxAudits = 4;

// One of the audits at a time.
class RunningAudit {
 public:
  explicit RunningAudit(std::atomic<int>* count) : count_(*count), number_(++count_) {}
  ~RunningAudit() { --count_; }
  RunningAudit(const RunningAudit&) = delete;
  RunningAudit& operator=(const RunningAudit&) = delete;
  int number() const { return number_; }

 private:
  std::atomic<int>& count_;
  const int number_;
};

class SessionService final
    : public v1::SessionService::WithCallbackMethod_WatchSession<
          v1::SessionService::WithCallbackMethod_ReadObservations<v1::SessionService::Service>> {
 public:
  SessionService(const RpcServerParts& parts, WatchHub* watches, ObservationReaders* readers)
      : coordinator_(*parts.coordinator),
        directory_(*parts.directory),
        store_(*parts.store),
        watches_(*watches),
        readers_(*readers) {}

  grpc::Status CreateSession(grpc::ServerContext* context, const v1::CreateSessionRequest* request,
                             v1::CreateSessionResponse* response) override {
    return CorrelatedCall("CreateSession", context, {.session = request->id()},
                          [&]() -> absl::Status {
                            RIGCAL_ASSIGN_OR_RETURN(Session session, wire::FromProto(*request));
                            return Describe(coordinator_.CreateSession(std::move(session)),
                                            response->mutable_session());
                          });
  }

  grpc::Status StartSession(grpc::ServerContext* context, const v1::StartSessionRequest* request,
                            v1::StartSessionResponse* response) override {
    return CorrelatedCall("StartSession", context, {.session = request->id()}, [&] {
      return Describe(coordinator_.StartSession(request->id()), response->mutable_session());
    });
  }

  grpc::Status StopSession(grpc::ServerContext* context, const v1::StopSessionRequest* request,
                           v1::StopSessionResponse* response) override {
    return CorrelatedCall(
        "StopSession", context, {.session = request->id()}, [&]() -> absl::Status {
          RIGCAL_RETURN_IF_ERROR(wire::CheckDuration(request->drain_timeout(), "drain_timeout"));
          return Describe(
              coordinator_.StopSession(request->id(), wire::SecondsOf(request->drain_timeout())),
              response->mutable_session());
        });
  }

  grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                          v1::GetSessionResponse* response) override {
    return GuardedCall("GetSession", [&]() -> absl::Status {
      const absl::StatusOr<Session> session = store_.GetSession(request->id());
      RIGCAL_RETURN_IF_ERROR(Describe(session, response->mutable_session()));
      return request->audit() ? Audit(*session, response) : absl::OkStatus();
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
          [](const SessionSummary& summary, v1::Session* proto) {
            *proto = wire::ToProto(summary);
            return absl::OkStatus();
          },
          response->mutable_sessions(), response->mutable_next_page_token());
    });
  }

  grpc::Status DeleteSession(grpc::ServerContext* context, const v1::DeleteSessionRequest* request,
                             v1::DeleteSessionResponse*) override {
    return CorrelatedCall("DeleteSession", context, {.session = request->id()},
                          [&] { return coordinator_.DeleteSession(request->id()); });
  }

  grpc::Status PruneSessions(grpc::ServerContext* context, const v1::PruneSessionsRequest* request,
                             v1::PruneSessionsResponse* response) override {
    return CorrelatedCall("PruneSessions", context, {}, [&]() -> absl::Status {
      RIGCAL_RETURN_IF_ERROR(wire::CheckDuration(request->older_than(), "older_than"));
      PruneOptions options;
      options.rig = request->rig();
      if (request->older_than().seconds() < 0 || request->older_than().seconds() > kMaxAgeS) {
        return absl::InvalidArgumentError("older_than: must not be negative, nor above 100 years");
      }
      options.max_age_ns = static_cast<int64_t>(1e9 * wire::SecondsOf(request->older_than()));
      options.max_bytes = request->max_bytes();
      options.include_calibrated = request->include_calibrated();
      options.dry_run = request->dry_run();
      RIGCAL_ASSIGN_OR_RETURN(const std::vector<PrunedSession> pruned,
                              server::PruneSessions(options, &store_, &coordinator_));
      for (const PrunedSession& session : pruned) {
        v1::PrunedSession* const proto = response->add_sessions();
        proto->set_id(session.id);
        proto->set_observation_count(session.observation_count);
        proto->set_reason(session.reason);
        proto->set_kept(session.kept);
      }
      response->set_used_bytes(UsedStoreBytes(store_));
      return absl::OkStatus();
    });
  }

  grpc::Status DiscardSession(grpc::ServerContext* context,
                              const v1::DiscardSessionRequest* request,
                              v1::DiscardSessionResponse* response) override {
    return CorrelatedCall("DiscardSession", context, {.session = request->id()}, [&] {
      return Describe(coordinator_.DiscardSession(request->id(), request->undo()),
                      response->mutable_session());
    });
  }

  grpc::ServerWriteReactor<v1::WatchSessionResponse>* WatchSession(
      grpc::CallbackServerContext*, const v1::WatchSessionRequest* request) override {
    if (const absl::Status fault = wire::FaultOf(*request); !fault.ok()) {
      return new RefusedWatch<v1::WatchSessionResponse>(fault);
    }
    const std::string id = request->id();
    return watches_.Open<v1::WatchSessionResponse>(
        [&](std::function<void()> wake) { return coordinator_.WatchSession(id, std::move(wake)); },
        [this, id](v1::WatchSessionResponse* response) -> absl::StatusOr<bool> {
          RIGCAL_RETURN_IF_ERROR(Describe(store_.GetSession(id), response->mutable_session()));
          return response->session().state() == v1::Session::STATE_FINISHED;
        });
  }

  ObservationReaders::Reactor* ReadObservations(
      grpc::CallbackServerContext* context, const v1::ReadObservationsRequest* request) override {
    return readers_.Open(context, *request);
  }

 private:
  absl::Status Audit(const Session& session, v1::GetSessionResponse* response) const {
    const RunningAudit running(&running_audits_);
    if (running.number() > kMaxAudits) {
      return absl::ResourceExhaustedError(
          absl::StrCat(kMaxAudits, " sessions are read for their audit now; try again later"));
    }
    RIGCAL_ASSIGN_OR_RETURN(std::vector<StreamAudit> audits, store_.AuditStreams(session.id));
    for (StreamAudit& audit : audits) {
      // Of an agent's words the last ones count, whether or not they are stored yet.
      if (auto report = directory_.StreamReport(audit.stream)) audit.reported = std::move(report);
      const SessionCamera* const camera = session.FindCamera(audit.stream.camera);
      if (camera != nullptr) audit.agent_id = camera->agent_id;
      audit.holder = directory_.HolderOf(audit.agent_id, audit.stream);
      *response->add_audit() = wire::ToProto(audit);
    }
    if (response->ByteSizeLong() > kMaxAuditedBytes) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the audit of session '", session.id, "' with its ", audits.size(),
                       " streams does not fit into one answer; read the session without it"));
    }
    return absl::OkStatus();
  }

  absl::Status Describe(const absl::StatusOr<Session>& session, v1::Session* response) const {
    RIGCAL_RETURN_IF_ERROR(session.status());
    RIGCAL_ASSIGN_OR_RETURN(const auto counts, store_.GetSessionCounts(session->id));
    *response = wire::ToProto(*session, counts, directory_.ConnectedCameraNames(session->rig));
    FitAnswer(response);
    return absl::OkStatus();
  }

  mutable std::atomic<int> running_audits_ = 0;
  SessionCoordinator& coordinator_;
  const AgentDirectory& directory_;
  Store& store_;
  WatchHub& watches_;
  ObservationReaders& readers_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeSessionService(const RpcServerParts& parts, WatchHub* watches,
                                                  ObservationReaders* readers) {
  return std::make_unique<SessionService>(parts, watches, readers);
}

}  // namespace rigcal::server
