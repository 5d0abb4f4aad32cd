// SPDX-License-Identifier: Apache-2.0
// The part of SessionCoordinator that speaks with agents and finishes sessions.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"
#include "server/session/session_coordinator.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {

absl::StatusOr<StreamPosition> SessionCoordinator::PositionOf(const StreamKey& stream) const {
  StreamPosition position{.stream = stream};
  const absl::StatusOr<StreamStatus> status = store_->GetStream(stream);
  if (absl::IsNotFound(status.status())) {
    position.unknown = true;
    return position;
  }
  RIGCAL_RETURN_IF_ERROR(status.status());
  position.durable_seq = status->durable_seq;
  const uint64_t limit = uint64_t{status->durable_seq} + options_.send_window;
  position.send_limit_seq = static_cast<uint32_t>(std::min<uint64_t>(limit, UINT32_MAX));
  return position;
}

absl::StatusOr<SessionCoordinator::AgentConnection> SessionCoordinator::ConnectAgent(
    AgentRecord agent, absl::Span<const StreamKey> pending, std::shared_ptr<AgentLink> link) {
  std::lock_guard change(change_mutex_);
  AgentConnection connection;
  std::set<std::string> announced;
  for (const AnnouncedCamera& camera : agent.cameras) announced.insert(camera.description.camera);
  for (const StreamKey& stream : pending) {
    RIGCAL_ASSIGN_OR_RETURN(StreamPosition position, PositionOf(stream));
    if (!announced.contains(stream.camera) ||
        !contexts_.CheckAgent(stream, agent.agent_id, agent.rig).ok()) {
      position = {.stream = stream, .unknown = true};
    }
    connection.positions.push_back(std::move(position));
  }

  const std::string agent_id = agent.agent_id;
  const std::string rig = agent.rig;
  RIGCAL_ASSIGN_OR_RETURN(connection.registration,
                          directory_->Register(std::move(agent), std::move(link)));
  std::vector<AgentDirectory::ConnectedCamera> own = directory_->ConnectedCameras(rig);
  std::erase_if(own, [&](const auto& camera) { return camera.agent_id != agent_id; });
  for (const Session& session : ActiveSessions()) {
    if (session.rig != rig) continue;
    if (absl::Status status = ResumeCapture(session, own); !status.ok()) {
      directory_->Unregister(connection.registration);
      return status;
    }
    changes_.Notify(session.id);
  }
  return connection;
}

absl::Status SessionCoordinator::ResumeCapture(
    const Session& session, absl::Span<const AgentDirectory::ConnectedCamera> connected) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<SessionCameraCounts> counts,
                          store_->GetSessionCounts(session.id));
  std::vector<CaptureOrder> orders = OrdersFor(session, connected);
  for (CaptureOrder& order : orders) {
    // A camera that has ended must not begin its recording again.
    std::erase_if(order.command.cameras, [&](const StreamPosition& position) {
      return std::any_of(counts.begin(), counts.end(), [&](const SessionCameraCounts& count) {
        return count.camera == position.stream.camera && count.ended();
      });
    });
    for (StreamPosition& position : order.command.cameras) {
      RIGCAL_ASSIGN_OR_RETURN(position, PositionOf(position.stream));
    }
  }
  QueueOrders(session, std::move(orders));
  return absl::OkStatus();
}

std::vector<SessionCoordinator::CaptureOrder> SessionCoordinator::OrdersFor(
    const Session& session, absl::Span<const AgentDirectory::ConnectedCamera> connected) const {
  std::map<std::string, CaptureOrder> by_agent;
  for (const AgentDirectory::ConnectedCamera& camera : connected) {
    const std::string& name = camera.camera.description.camera;
    const SessionCamera* own = session.FindCamera(name);
    if (own == nullptr || own->agent_id != camera.agent_id) continue;
    CaptureOrder& order = by_agent[camera.agent_id];
    order.link = camera.link;
    order.command.session_id = session.id;
    order.command.target = session.target;
    order.command.cameras.push_back({.stream = {session.id, name, camera.camera.stream_epoch},
                                     .durable_seq = 0,
                                     .send_limit_seq = options_.send_window,
                                     .unknown = false});
  }
  std::vector<CaptureOrder> orders;
  for (auto& [agent_id, order] : by_agent) orders.push_back(std::move(order));
  return orders;
}

void SessionCoordinator::QueueOrders(const Session& session, std::vector<CaptureOrder> orders) {
  const bool draining = session.state == SessionState::kDraining;
  for (CaptureOrder& order : orders) {
    if (order.command.cameras.empty()) continue;
    Queue([link = std::move(order.link), command = std::move(order.command), draining] {
      link->SendStartCapture(command);
      if (draining) link->SendStopCapture(command.session_id);
    });
  }
}

void SessionCoordinator::StopLateCapture(const StreamKey& stream) {
  const std::optional<StreamContextCache::Owner> owner = contexts_.FindOwner(stream);
  if (!owner) return;
  for (const AgentDirectory::ConnectedCamera& camera : directory_->ConnectedCameras(owner->rig)) {
    if (camera.camera.description.camera != stream.camera || camera.agent_id != owner->agent_id) {
      continue;
    }
    {
      std::lock_guard lock(mutex_);
      if (!told_to_stop_.emplace(camera.registration, stream.session_id).second) return;
    }
    spdlog::info("session {}: agent {} still captures for it, and is told to stop",
                 stream.session_id, owner->agent_id);
    camera.link->SendStopCapture(stream.session_id);
  }
}

void SessionCoordinator::DisconnectAgent(AgentDirectory::Registration registration) {
  {
    std::lock_guard lock(mutex_);
    std::erase_if(told_to_stop_, [&](const auto& told) { return told.first == registration; });
  }
  if (!directory_->Unregister(registration)) return;
  for (const Session& session : ActiveSessions()) changes_.Notify(session.id);
}

void SessionCoordinator::RecordProgress(const StreamKey& stream, const AppendOutcome& outcome) {
  if (outcome.complete) {
    {
      std::lock_guard lock(mutex_);
      if (active_.contains(stream.session_id)) finish_checks_.insert(stream.session_id);
    }
    wake_.notify_all();
  }
  // It was away when the session was stopped, and came back after its end.
  if (outcome.late && !outcome.complete) Queue([this, stream] { StopLateCapture(stream); });
  changes_.Notify(stream.session_id);
}

void SessionCoordinator::Queue(std::function<void()> command) {
  {
    std::lock_guard lock(mutex_);
    commands_.push_back(std::move(command));
  }
  wake_.notify_all();
}

void SessionCoordinator::Start() {
  std::lock_guard lock(mutex_);
  if (!thread_.joinable() && !stopping_) thread_ = std::thread([this] { Run(); });
}

void SessionCoordinator::Shutdown() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  idle_.notify_all();
  if (thread_.joinable()) thread_.join();
  changes_.Shutdown();
}

void SessionCoordinator::WaitIdle() {
  std::unique_lock lock(mutex_);
  idle_.wait(lock, [this] {
    return stopping_ || (commands_.empty() && finish_checks_.empty() && !working_);
  });
}

std::optional<SessionCoordinator::SteadyTime> SessionCoordinator::TakeDue(
    std::set<std::string>* overdue) {
  const SteadyTime now = std::chrono::steady_clock::now();
  std::optional<SteadyTime> next;
  for (auto& [id, active] : active_) {
    if (active.check_at && *active.check_at <= now) {
      active.check_at.reset();
      finish_checks_.insert(id);
    }
    if (active.finish_at && *active.finish_at <= now) {
      overdue->insert(id);
      // In case that it cannot be finished now.
      active.finish_at = now + options_.store_retry_interval;
    }
    for (const auto& time : {active.check_at, active.finish_at}) {
      if (time) next = next ? std::min(*next, *time) : *time;
    }
  }
  return next;
}

void SessionCoordinator::Run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    std::set<std::string> overdue;
    const std::optional<SteadyTime> next = TakeDue(&overdue);
    if (commands_.empty() && finish_checks_.empty() && overdue.empty()) {
      idle_.notify_all();
      // Woken by every change; the loop looks at everything again.
      if (next) {
        wake_.wait_until(lock, *next);
      } else {
        wake_.wait(lock);
      }
      continue;
    }
    auto commands = std::exchange(commands_, {});
    const auto due = std::exchange(finish_checks_, {});
    working_ = true;
    lock.unlock();
    Work(std::move(commands), due, overdue);
    lock.lock();
    working_ = false;
  }
}

void SessionCoordinator::Work(std::deque<std::function<void()>> commands,
                              const std::set<std::string>& due,
                              const std::set<std::string>& overdue) {
  try {
    for (const auto& command : commands) command();
    for (const std::string& id : due) {
      if (!overdue.contains(id)) FinishIfEnded(id, /*overdue=*/false);
    }
    for (const std::string& id : overdue) FinishIfEnded(id, /*overdue=*/true);
  } catch (const std::exception& error) {
    spdlog::error("sessions: an unexpected fault: {}", error.what());
  }
}

void SessionCoordinator::FinishIfEnded(const std::string& id, bool overdue) {
  std::lock_guard change(change_mutex_);
  Session session;
  {
    std::lock_guard lock(mutex_);
    const auto found = active_.find(id);
    if (found == active_.end()) return;
    session = found->second.session;
  }
  const auto try_again_later = [&](const absl::Status& status) {
    spdlog::warn("session {}: cannot be finished now, will be tried again: {}", id,
                 std::string(status.message()));
    std::lock_guard lock(mutex_);
    active_.at(id).check_at = std::chrono::steady_clock::now() + options_.store_retry_interval;
  };
  const auto counts = store_->GetSessionCounts(id);
  if (!counts.ok()) return try_again_later(counts.status());
  std::set<std::string> ended;
  for (const SessionCameraCounts& camera : *counts) {
    if (camera.ended()) ended.insert(camera.camera);
  }
  session.missing_cameras.clear();
  for (const SessionCamera& camera : session.cameras) {
    if (!ended.contains(camera.description.camera)) {
      session.missing_cameras.push_back(camera.description.camera);
    }
  }
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
  changes_.Notify(id);
  if (session.missing_cameras.empty()) {
    spdlog::info("session {}: finished, every camera has ended", id);
  } else {
    spdlog::warn("session {}: finished at its deadline; missing: {}", id,
                 absl::StrJoin(session.missing_cameras, ", "));
  }
}

}  // namespace rigcal::server
