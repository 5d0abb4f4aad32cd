// SPDX-License-Identifier: Apache-2.0
#include "server/live/live_tracker.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <random>

#include "absl/strings/str_format.h"
#include "server/live/followed_rig.h"
#include "server/live/live_limits.h"
#include "server/live/rig_state.h"
#include "server/live/session_goal.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr size_t kMaxRigs = 64;
constexpr int kListedSessions = 200;
constexpr milliseconds kAgentInterval{500};
constexpr seconds kHealthInterval{2};
constexpr size_t kMaxEstimates = 16;

uint64_t RandomNumber() {
  std::random_device random;
  return uint64_t{random()} << 32 | random();
}

}  // namespace

struct LiveTracker::Rig {
  std::string name;
  FollowedRig followed = {};
  RigState state;
  std::optional<Time> stop_time = {};  // when it was last stopped because of its goal
};

LiveTracker::LiveTracker(LiveTrackerOptions options, Store* store, const AgentDirectory* directory,
                         SessionCoordinator* coordinator)
    : options_(std::move(options)),
      store_(store),
      directory_(directory),
      coordinator_(coordinator),
      incarnation_(RandomNumber()),
      begin_utc_ns_(UtcNow()) {
  Update();
}

LiveTracker::~LiveTracker() { Shutdown(); }

void LiveTracker::SetRowTap(RowTap tap) { row_tap_ = std::move(tap); }

void LiveTracker::SetEarlierTap(EarlierTap tap) { earlier_tap_ = std::move(tap); }

void LiveTracker::Start() {
  stops_.Start();
  reading_.Start();
  thread_ = std::thread([this] { Run(); });
}

void LiveTracker::Shutdown() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
  stops_.Shutdown();
  reading_.Shutdown();
}

void LiveTracker::Run() {
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (wake_.wait_for(lock, options_.interval, [this] { return stopping_.load(); })) return;
    }
    try {
      Update();
    } catch (const std::exception& error) {
      spdlog::error("live state: {}", error.what());
    }
  }
}

LiveTracker::Time LiveTracker::Now() const {
  return options_.steady_now ? options_.steady_now() : std::chrono::steady_clock::now();
}

int64_t LiveTracker::UtcNow() const { return UtcNowNs(options_.utc_now_ns); }

void LiveTracker::RecordDelivery(const Delivery& delivery, const AppendOutcome& outcome) {
  if (outcome.late) return;
  inbox_.Add(delivery, outcome, Now());
  if (!row_tap_ || outcome.stored_rows == 0) return;
  if (delivery.refused_rows.empty()) return row_tap_(delivery.stream(), delivery.batch);
  StoredBatch stored{.batch = delivery.batch,
                     .refused_rows = std::vector<bool>(delivery.batch.rows())};
  for (const RefusedRow& refused : delivery.refused_rows) {
    if (refused.row < stored.refused_rows.size()) stored.refused_rows[refused.row] = true;
  }
  for (const ObservationBatch& batch : AcceptedRows(std::move(stored))) {
    row_tap_(delivery.stream(), batch);
  }
}

void LiveTracker::SetEstimate(LiveEstimate estimate) {
  LimitEstimate(&estimate);
  auto shared = std::make_shared<const LiveEstimate>(std::move(estimate));
  const std::lock_guard lock(mutex_);
  if (estimates_.size() >= kMaxEstimates && !estimates_.contains(shared->session_id)) return;
  estimates_.insert_or_assign(shared->session_id, shared);
}

void LiveTracker::SetMonitor(const std::string& rig, LiveMonitor monitor) {
  LimitMonitor(&monitor);
  const std::lock_guard lock(mutex_);
  if (monitors_.size() >= kMaxRigs && !monitors_.contains(rig)) return;
  monitors_[rig] = std::make_shared<const LiveMonitor>(std::move(monitor));
}

std::string LiveTracker::IncarnationOf(std::string_view rig) const {
  // Another one for each rig, so that a revision of one says nothing of another.
  const uint64_t hash = std::hash<std::string_view>()(rig);
  return absl::StrFormat("%016x", incarnation_ ^ hash);
}

std::shared_ptr<const LiveSnapshot> LiveTracker::EmptyState(std::string_view rig) const {
  auto empty = std::make_shared<LiveSnapshot>();
  empty->incarnation = IncarnationOf(rig);
  empty->time_utc_ns = UtcNow();
  empty->rig = rig;
  return empty;
}

std::shared_ptr<const LiveSnapshot> LiveTracker::Get(std::string_view rig) const {
  {
    const std::lock_guard lock(mutex_);
    const auto found = published_.find(rig);
    if (found != published_.end()) return found->second;
  }
  return EmptyState(rig);
}

LiveTracker::Rig* LiveTracker::FindOrAddRig(std::string_view name) {
  const auto found = rigs_.find(name);
  if (found != rigs_.end()) return found->second.get();
  if (rigs_.size() >= kMaxRigs) return nullptr;
  auto rig = std::make_unique<Rig>(
      Rig{.name = std::string(name), .state = RigState(std::string(name), IncarnationOf(name))});
  return rigs_.emplace(name, std::move(rig)).first->second.get();
}

void LiveTracker::Update() {
  const std::lock_guard update(update_mutex_);
  const Time now = Now();
  // Before the sessions: a session is known before its first row comes.
  std::vector<std::pair<StreamKey, Arrivals>> arrivals = inbox_.Take();
  if (const uint64_t count = coordinator_->ChangeCount(); change_count_ != count) {
    change_count_ = count;
    FollowSessions();
    agents_time_.reset();
  }
  if (!agents_time_ || now - *agents_time_ >= kAgentInterval) {
    agents_time_ = now;
    FollowAgents();
  }
  if (!health_time_ || now - *health_time_ >= kHealthInterval) {
    health_time_ = now;
    health_ = store_->Health();
  }
  TakeArrivals(std::move(arrivals));
  TakeEarlier();
  TakeEstimates();
  TakeMonitors();
  for (const auto& [name, rig] : rigs_) Publish(rig.get());
}

void LiveTracker::FollowSessions() {
  // The one that captures, else the newest; the list has the newest first.
  std::map<std::string, std::string> chosen;
  std::set<std::string> capturing;
  for (const Session& session : coordinator_->ActiveSessions()) {
    if (session.state != SessionState::kCapturing) continue;
    chosen[session.rig] = session.id;
    capturing.insert(session.rig);
  }
  const auto listed = store_->ListSessions({}, {.limit = kListedSessions});
  if (!listed.ok()) {
    change_count_.reset();  // again with the next update
    return;
  }
  for (const auto& [summary, position] : *listed) {
    if (summary.damage.empty()) chosen.try_emplace(summary.session.rig, summary.session.id);
  }
  for (const auto& [rig, id] : chosen) FindOrAddRig(rig);
  for (const auto& [name, rig] : rigs_) {
    const auto found = chosen.find(name);
    if (found != chosen.end()) {
      FollowSession(rig.get(), found->second);
    } else if (rig->followed.session()) {
      FollowSession(rig.get(), rig->followed.session()->id);
    }
  }
}

void LiveTracker::FollowSession(Rig* rig, std::string_view id) {
  FollowedRig& followed = rig->followed;
  const absl::StatusOr<Session> session = store_->GetSession(id);
  if (session.ok()) {
    if (!followed.Follow(*session, Now())) return;
  } else {
    if (!followed.session()) return;
    followed.ForgetSession();
  }
  rig->state.Reset();
  rig->stop_time.reset();
  if (!session.ok()) return;
  // Since the tracker began it has counted itself.
  if (session->state == SessionState::kCapturing && session->start_utc_ns >= begin_utc_ns_) {
    ReadEarlier(*session, {});
    return;
  }
  const auto counts = store_->GetSessionCounts(id);
  if (!counts.ok()) return;
  followed.SetStored(*counts);
  if (session->state == SessionState::kCapturing) ReadEarlier(*session, *counts);
}

void LiveTracker::ReadEarlier(const Session& session,
                              const std::vector<SessionCameraCounts>& own_counts) {
  EarlierWaves waves{.session = session, .now_utc_ns = UtcNow()};
  for (const SessionCameraCounts& camera : own_counts) {
    for (const StreamStatus& stream : camera.streams) {
      if (stream.durable_seq == 0) continue;
      waves.own_until[{camera.camera, stream.stream_epoch}] = stream.durable_seq;
    }
  }
  if (waves.own_until.empty() && waves.session.continues.empty()) return;
  // Whoever collects rows keeps them, also while the rig shows another session.
  const bool tapped = !read_sessions_.insert(waves.session.id).second;
  {
    const std::lock_guard lock(mutex_);
    reading_sessions_.insert(waves.session.id);
  }
  reading_.Post([this, waves = std::move(waves), tapped] {
    EarlierRowTap tap;
    if (earlier_tap_ && !tapped) {
      tap = [&](const SessionCamera& camera, const ObservationBatch& rows) {
        earlier_tap_(waves.session.id, camera, rows);
      };
    }
    absl::StatusOr<EarlierCounts> counts = ReadEarlierWaves(*store_, waves, stopping_, tap);
    const std::lock_guard lock(mutex_);
    reading_sessions_.erase(reading_sessions_.find(waves.session.id));
    if (!counts.ok()) return;  // the server ends
    earlier_.insert_or_assign(waves.session.id, *std::move(counts));
  });
}

bool LiveTracker::ReadsEarlier(std::string_view session_id) const {
  const std::lock_guard lock(mutex_);
  return reading_sessions_.contains(session_id);
}

void LiveTracker::TakeEarlier() {
  std::map<std::string, EarlierCounts, std::less<>> earlier;
  {
    const std::lock_guard lock(mutex_);
    earlier.swap(earlier_);
  }
  for (const auto& [name, rig] : rigs_) {
    if (!rig->followed.session()) continue;
    const auto found = earlier.find(rig->followed.session()->id);
    if (found != earlier.end()) rig->followed.AddEarlier(found->second);
  }
}

void LiveTracker::FollowAgents() {
  std::map<std::string, std::vector<AgentRecord>> by_rig;
  for (AgentRecord& agent : directory_->List("")) by_rig[agent.rig].push_back(std::move(agent));
  for (const auto& [rig, agents] : by_rig) FindOrAddRig(rig);
  for (const auto& [name, rig] : rigs_) rig->followed.SetAgents(std::move(by_rig[name]));
}

void LiveTracker::TakeArrivals(std::vector<std::pair<StreamKey, Arrivals>> arrivals) {
  const Time now = Now();
  const int64_t utc_ns = UtcNow();
  std::map<std::string_view, FollowedRig*> by_session;
  for (const auto& [name, rig] : rigs_) {
    if (rig->followed.session()) by_session[rig->followed.session()->id] = &rig->followed;
  }
  for (const auto& [stream, arrived] : arrivals) {
    const auto found = by_session.find(stream.session_id);
    if (found != by_session.end()) found->second->AddArrivals(stream, arrived, now, utc_ns);
  }
  // After all streams, which may change the clock offsets.
  for (const auto& [session_id, rig] : by_session) rig->CountOverlap(arrivals);
}

void LiveTracker::TakeEstimates() {
  std::map<std::string, std::shared_ptr<const LiveEstimate>, std::less<>> estimates;
  {
    const std::lock_guard lock(mutex_);
    estimates.swap(estimates_);
  }
  for (const auto& [name, rig] : rigs_) {
    if (!rig->followed.session()) continue;
    const auto found = estimates.find(rig->followed.session()->id);
    if (found != estimates.end()) rig->followed.SetEstimate(found->second);
  }
}

void LiveTracker::TakeMonitors() {
  std::map<std::string, std::shared_ptr<const LiveMonitor>, std::less<>> monitors;
  {
    const std::lock_guard lock(mutex_);
    monitors = monitors_;
  }
  for (const auto& [name, monitor] : monitors) {
    if (Rig* const rig = FindOrAddRig(name); rig != nullptr) rig->followed.SetMonitor(monitor);
  }
}

void LiveTracker::Publish(Rig* rig) {
  const Time now = Now();
  rig->followed.Advance(now);
  std::shared_ptr<const LiveSnapshot> changed =
      rig->state.Update(rig->followed, health_, last_revision_ + 1, now, UtcNow());
  const LiveGoal* const goal = rig->state.snapshot().goal.value.get();
  if (rig->followed.capturing() && goal != nullptr && goal->reached) StopAtGoal(rig, *goal);
  if (changed == nullptr) return;
  last_revision_ = changed->revision;
  const std::lock_guard lock(mutex_);
  published_.insert_or_assign(rig->name, std::move(changed));
}

void LiveTracker::StopAtGoal(Rig* rig, const LiveGoal& goal) {
  const Time now = Now();
  // It stays as it is until the coordinator has stopped it; after an error it is tried again.
  if (rig->stop_time && now - *rig->stop_time < seconds(2)) return;
  rig->stop_time = now;
  stops_.Post([this, id = rig->followed.session()->id, reason = StopReason(goal)] {
    const auto stopped = coordinator_->StopSession(id, 0, reason);
    if (!stopped.ok()) {
      spdlog::warn("session {} has reached its goal and cannot be stopped: {}", id,
                   std::string(stopped.status().message()));
    }
  });
}

}  // namespace rigcal::server
