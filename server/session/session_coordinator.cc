// SPDX-License-Identifier: Apache-2.0
#include "server/session/session_coordinator.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/log/log_fields.h"
#include "common/status/status_macros.h"
#include "server/session/session_rules.h"
#include "server/session/stream_opening.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr int kSessionPageSize = 500;

std::chrono::nanoseconds DrainTimeLeft(const Session& session, int64_t now_utc_ns) {
  // A clock that was set back while the server was down must not stretch the wait.
  constexpr std::chrono::nanoseconds kMost = std::chrono::seconds(600);
  const std::chrono::nanoseconds left(session.drain_deadline_utc_ns - now_utc_ns);
  return std::clamp(left, std::chrono::nanoseconds::zero(), kMost);
}

}  // namespace

SessionCoordinator::SessionCoordinator(SessionCoordinatorOptions options, Store* store,
                                       AgentDirectory* directory)
    : options_(std::move(options)),
      store_(store),
      directory_(directory),
      orders_(store, options_.send_window),
      sender_(directory, &contexts_, &tasks_),
      changes_(options_.max_watches) {}

absl::StatusOr<std::unique_ptr<SessionCoordinator>> SessionCoordinator::Create(
    SessionCoordinatorOptions options, Store* store, AgentDirectory* directory) {
  std::unique_ptr<SessionCoordinator> coordinator(
      new SessionCoordinator(std::move(options), store, directory));
  RIGCAL_RETURN_IF_ERROR(coordinator->Load());
  return coordinator;
}

absl::Status SessionCoordinator::Load() {
  ListPage next{.limit = kSessionPageSize};
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const auto page, store_->ListSessions({}, next));
    for (const auto& [summary, position] : page) {
      const absl::StatusOr<Session> session = store_->GetSession(position.id);
      if (absl::IsDataLoss(session.status())) {
        // The others go on. What still arrives for this one is refused.
        spdlog::error("{}", std::string(session.status().message()));
        continue;
      }
      RIGCAL_RETURN_IF_ERROR(session.status());
      contexts_.Put(*session);
      if (session->state != SessionState::kCapturing && session->state != SessionState::kDraining) {
        continue;
      }
      Activate(*session);
      spdlog::info("session {}: continues after a restart with {} cameras", session->id,
                   session->cameras.size());
    }
    if (page.size() < static_cast<size_t>(kSessionPageSize)) return absl::OkStatus();
    next.after = page.back().position;
  }
}

void SessionCoordinator::Activate(const Session& session) {
  contexts_.Put(session);
  {
    std::lock_guard lock(mutex_);
    active_.insert_or_assign(session.id, session);
  }
  ++change_count_;
  PostFinishCheck(session.id);
  if (session.state == SessionState::kDraining) {
    PostDeadline(session.id, DrainTimeLeft(session, UtcNowNs(options_.utc_now_ns)));
  }
  changes_.Notify(session.id);
}

absl::StatusOr<Session> SessionCoordinator::CreateSession(Session session) {
  RIGCAL_RETURN_IF_ERROR(ValidateNewSession(session, options_.max_cameras_per_session));
  std::lock_guard change(change_mutex_);
  if (!session.continues.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const Session earlier, store_->GetSession(session.continues));
    RIGCAL_RETURN_IF_ERROR(CheckContinues(session, earlier));
  }
  if (contexts_.size() >= options_.max_sessions) {
    return absl::ResourceExhaustedError(absl::StrCat("there are ", contexts_.size(),
                                                     " sessions, which is the limit; delete some, "
                                                     "or raise limits.max_sessions on the server"));
  }
  session.state = SessionState::kCreated;
  session.create_utc_ns = UtcNowNs(options_.utc_now_ns);
  std::sort(session.cameras.begin(), session.cameras.end(), [](const auto& a, const auto& b) {
    return a.description.camera < b.description.camera;
  });
  RIGCAL_ASSIGN_OR_RETURN(session, store_->CreateSession(std::move(session)));
  contexts_.Put(session);
  ++change_count_;
  const LogScope scope({.session = session.id});
  spdlog::info("session {}: created", session.id);
  return session;
}

absl::StatusOr<Session> SessionCoordinator::StartSession(std::string_view id) {
  std::lock_guard change(change_mutex_);
  RIGCAL_ASSIGN_OR_RETURN(Session session, store_->GetSession(id));
  if (session.state == SessionState::kCapturing) return session;
  RIGCAL_RETURN_IF_ERROR(CheckMayStart(session));
  const auto connected = directory_->ConnectedCameras(session.rig);
  RIGCAL_ASSIGN_OR_RETURN(session.cameras,
                          ChooseCameras(session, connected, options_.max_cameras_per_session));
  RIGCAL_RETURN_IF_ERROR(CheckNotCapturing(session, ActiveSessions()));
  session.state = SessionState::kCapturing;
  session.start_utc_ns = UtcNowNs(options_.utc_now_ns);
  RIGCAL_RETURN_IF_ERROR(store_->UpdateSession(session));
  Activate(session);
  spdlog::info("session {}: capturing with {} cameras", session.id, session.cameras.size());
  std::vector<CaptureOrder> orders = orders_.ToStart(session, connected);
  // The session has started: an order is not held back for this.
  if (const absl::Status status = OpenStreams(StreamsOf(orders), store_); !status.ok()) {
    spdlog::warn("session {}: its streams are not noted: {}", session.id,
                 std::string(status.message()));
  }
  sender_.SendStart(session, std::move(orders));
  return session;
}

absl::StatusOr<Session> SessionCoordinator::StopSession(std::string_view id, double drain_timeout_s,
                                                        std::string_view reason) {
  RIGCAL_ASSIGN_OR_RETURN(const double timeout_s, DrainTimeout(drain_timeout_s));
  std::lock_guard change(change_mutex_);
  RIGCAL_ASSIGN_OR_RETURN(Session session, store_->GetSession(id));
  RIGCAL_RETURN_IF_ERROR(CheckMayStop(session));
  if (session.state != SessionState::kCapturing) return session;
  session.stop_reason = reason;
  session.state = SessionState::kDraining;
  session.stop_utc_ns = UtcNowNs(options_.utc_now_ns);
  session.drain_deadline_utc_ns = session.stop_utc_ns + static_cast<int64_t>(timeout_s * 1e9);
  RIGCAL_RETURN_IF_ERROR(store_->UpdateSession(session));
  sender_.SendStop(session);
  Activate(session);
  spdlog::info("session {}: draining, at most {} s{}{}", session.id, timeout_s,
               session.stop_reason.empty() ? "" : "; ", session.stop_reason);
  return session;
}

absl::Status SessionCoordinator::DeleteSession(std::string_view id) {
  std::lock_guard change(change_mutex_);
  const absl::StatusOr<Session> stored = store_->GetSession(id);
  if (absl::IsDataLoss(stored.status())) {
    contexts_.Remove(id).IgnoreError();  // it is there if the damage is new
    RIGCAL_RETURN_IF_ERROR(store_->DeleteSession(id));
    ++change_count_;
    changes_.Notify(id);
    spdlog::info("session {}: deleted; its record was damaged", id);
    return absl::OkStatus();
  }
  RIGCAL_RETURN_IF_ERROR(stored.status());
  const Session& session = *stored;
  RIGCAL_RETURN_IF_ERROR(CheckNotRunning(session, "deleted"));
  RIGCAL_RETURN_IF_ERROR(contexts_.Remove(id));
  if (absl::Status status = store_->DeleteSession(id); !status.ok()) {
    contexts_.Put(session);
    return status;
  }
  ++change_count_;
  changes_.Notify(id);
  spdlog::info("session {}: deleted", session.id);
  return absl::OkStatus();
}

absl::StatusOr<Session> SessionCoordinator::DiscardSession(std::string_view id, bool undo) {
  std::lock_guard change(change_mutex_);
  RIGCAL_ASSIGN_OR_RETURN(Session session, store_->GetSession(id));
  if ((session.discard_utc_ns != 0) != undo) return session;
  RIGCAL_RETURN_IF_ERROR(CheckNotRunning(session, "thrown away"));
  session.discard_utc_ns = undo ? 0 : UtcNowNs(options_.utc_now_ns);
  RIGCAL_RETURN_IF_ERROR(store_->UpdateSession(session));
  ++change_count_;
  changes_.Notify(session.id);
  spdlog::info("session {}: {}", session.id,
               undo ? "counts again" : "thrown away; nothing deleted");
  return session;
}

absl::Status SessionCoordinator::DeleteObservations(std::string_view id) {
  std::lock_guard change(change_mutex_);
  RIGCAL_ASSIGN_OR_RETURN(const Session session, store_->GetSession(id));
  if (session.state != SessionState::kFinished) {
    return absl::FailedPreconditionError(
        absl::StrCat("session '", session.id, "' has not finished; its observations stay"));
  }
  RIGCAL_RETURN_IF_ERROR(contexts_.Remove(id));
  const absl::Status deleted = store_->DeleteObservations(id, UtcNowNs(options_.utc_now_ns));
  contexts_.Put(session);
  if (deleted.ok()) changes_.Notify(id);
  return deleted;
}

absl::StatusOr<SessionHold> SessionCoordinator::HoldSessions(const std::vector<std::string>& ids) {
  const std::shared_ptr<std::vector<std::string>> held(new std::vector<std::string>,
                                                       [this](std::vector<std::string>* ended) {
                                                         for (const std::string& id : *ended)
                                                           contexts_.RemoveReader(id);
                                                         delete ended;
                                                       });
  for (const std::string& id : ids) {
    RIGCAL_RETURN_IF_ERROR(contexts_.AddReader(id));
    held->push_back(id);
  }
  return held;
}

size_t SessionCoordinator::CapturingCount() const {
  std::lock_guard lock(mutex_);
  return static_cast<size_t>(std::count_if(active_.begin(), active_.end(), [](const auto& item) {
    return item.second.state == SessionState::kCapturing;
  }));
}

std::vector<Session> SessionCoordinator::ActiveSessions() const {
  std::vector<Session> sessions;
  std::lock_guard lock(mutex_);
  for (const auto& [id, session] : active_) sessions.push_back(session);
  return sessions;
}

absl::StatusOr<SessionCoordinator::AgentConnection> SessionCoordinator::ConnectAgent(
    AgentRecord agent, absl::Span<const StreamKey> pending, std::shared_ptr<AgentLink> link) {
  std::lock_guard change(change_mutex_);
  AgentConnection connection;
  for (const StreamKey& stream : pending) {
    RIGCAL_ASSIGN_OR_RETURN(StreamPosition position, orders_.PositionOf(stream));
    // The camera itself need not be there any more: what was captured is delivered all the same.
    // Of a session whose record is damaged nothing can be checked, so nothing is taken.
    if (absl::IsNotFound(contexts_.GetStreamContext(stream).status()) ||
        !contexts_.CheckAgent(stream, agent.agent_id, agent.rig).ok()) {
      position = {.stream = stream, .unknown = true};
    }
    connection.positions.push_back(std::move(position));
  }

  agent.pending.assign(pending.begin(), pending.end());
  std::vector<StreamKey> opened;
  for (const StreamPosition& position : connection.positions) {
    if (!position.unknown) opened.push_back(position.stream);
  }
  const AgentRecord record = agent;
  const std::string agent_id = agent.agent_id;
  const std::string rig = agent.rig;
  RIGCAL_ASSIGN_OR_RETURN(connection.registration,
                          directory_->Register(std::move(agent), std::move(link)));
  std::vector<AgentDirectory::ConnectedCamera> own = directory_->ConnectedCameras(rig);
  std::erase_if(own, [&](const auto& camera) { return camera.agent_id != agent_id; });
  for (const Session& session : ActiveSessions()) {
    if (session.rig != rig) continue;
    absl::StatusOr<std::vector<CaptureOrder>> orders = orders_.ToResume(session, own);
    absl::Status status = orders.status();
    if (status.ok()) status = EndStreamsNeverBegun(session, record, *directory_, store_);
    if (!status.ok()) {
      directory_->Unregister(connection.registration);
      return status;
    }
    for (StreamKey& stream : StreamsOf(*orders)) opened.push_back(std::move(stream));
    sender_.SendStart(session, *std::move(orders));
    changes_.Notify(session.id);
    PostFinishCheck(session.id);
  }
  // Before the agent is greeted, and so before anything of these streams can end.
  if (absl::Status status = OpenStreams(opened, store_); !status.ok()) {
    directory_->Unregister(connection.registration);
    return status;
  }
  return connection;
}

void SessionCoordinator::DisconnectAgent(AgentDirectory::Registration registration) {
  sender_.Forget(registration);
  if (!directory_->Unregister(registration)) return;
  for (const Session& session : ActiveSessions()) changes_.Notify(session.id);
}

void SessionCoordinator::RecordProgress(const StreamKey& stream, const AppendOutcome& outcome) {
  if (outcome.complete || outcome.unknown) directory_->ForgetStreamReport(stream);
  if (outcome.complete) PostFinishCheck(stream.session_id);
  // It was away when the session was stopped, and came back after its end.
  if (outcome.late && !outcome.complete) sender_.SendLateStop(stream);
  changes_.Notify(stream.session_id);
}

void SessionCoordinator::PostFinishCheck(const std::string& id, std::chrono::milliseconds delay) {
  {
    std::lock_guard lock(mutex_);
    if (!active_.contains(id) || !finish_checks_.insert(id).second) return;
  }
  const auto check = [this, id] {
    {
      std::lock_guard lock(mutex_);
      finish_checks_.erase(id);
    }
    FinishIfEnded(id, /*overdue=*/false);
  };
  if (delay.count() == 0) {
    tasks_.Post(check);
  } else {
    tasks_.PostAt(std::chrono::steady_clock::now() + delay, check);
  }
}

void SessionCoordinator::PostDeadline(const std::string& id, std::chrono::nanoseconds delay) {
  tasks_.PostAt(std::chrono::steady_clock::now() + delay,
                [this, id] { FinishIfEnded(id, /*overdue=*/true); });
}

void SessionCoordinator::FinishIfEnded(const std::string& id, bool overdue) {
  std::lock_guard change(change_mutex_);
  Session session;
  {
    std::lock_guard lock(mutex_);
    const auto found = active_.find(id);
    if (found == active_.end()) return;
    session = found->second;
  }
  const auto try_again_later = [&](const absl::Status& status) {
    spdlog::warn("session {}: cannot be finished now, will be tried again: {}", id,
                 std::string(status.message()));
    if (overdue) {
      PostDeadline(id, options_.store_retry_interval);
    } else {
      PostFinishCheck(id, options_.store_retry_interval);
    }
  };
  const auto counts = store_->GetSessionCounts(id);
  if (!counts.ok()) return try_again_later(counts.status());
  session.missing_cameras = CamerasNotEnded(session, *counts);
  if (!session.missing_cameras.empty() && !overdue) return;
  session.state = SessionState::kFinished;
  session.finish_utc_ns = UtcNowNs(options_.utc_now_ns);
  if (absl::Status status = store_->UpdateSession(session); !status.ok()) {
    return try_again_later(status);
  }
  contexts_.Put(session);
  {
    std::lock_guard lock(mutex_);
    active_.erase(id);
  }
  ++change_count_;
  changes_.Notify(id);
  if (session.missing_cameras.empty()) {
    spdlog::info("session {}: finished, every camera has ended", id);
  } else {
    spdlog::warn("session {}: finished at its deadline; missing: {}", id,
                 absl::StrJoin(session.missing_cameras, ", "));
  }
}

}  // namespace rigcal::server
