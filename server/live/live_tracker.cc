// SPDX-License-Identifier: Apache-2.0
#include "server/live/live_tracker.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"
#include "server/live/alert_rules.h"
#include "server/live/camera_activity.h"
#include "server/live/clock_relation.h"
#include "server/live/overlap_counter.h"
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
constexpr milliseconds kOverlapInterval{500};
constexpr seconds kCountInterval{1};
constexpr size_t kMaxRemoved = 256;
constexpr size_t kMaxEstimates = 16;
// Wanted of each camera; a dashboard shows it as a bar. It ends no session.
constexpr uint32_t kSharedInstantGoal = 200;
// A camera whose times are further ahead than this is not compared with others: one wrong clock
// must not hide the rest.
constexpr int64_t kMostAheadNs = 15'000'000'000;
// Limits of live.proto, and of texts so that an answer stays below 1 MiB.
constexpr size_t kMaxNeeds = 16;
constexpr size_t kMaxHistory = 300;
constexpr size_t kMaxAdvice = 3;
constexpr size_t kMaxVoxels = 4096;
constexpr size_t kMaxTextBytes = 1024;
constexpr size_t kMaxAlertBytes = 512;
constexpr size_t kMaxHostBytes = 128;
constexpr size_t kMaxVersionBytes = 64;

uint64_t RandomNumber() {
  std::random_device random;
  return uint64_t{random()} << 32 | random();
}

// Not in the middle of a character.
void Shorten(size_t bytes, std::string* text) {
  if (text->size() <= bytes) return;
  while (bytes > 0 && (static_cast<unsigned char>((*text)[bytes]) & 0xC0U) == 0x80U) --bytes;
  text->resize(bytes);
}

template <typename Value>
void Limit(size_t count, std::vector<Value>* values) {
  if (values->size() > count)
    values->erase(values->begin() + static_cast<std::ptrdiff_t>(count), values->end());
}

void LimitEstimate(LiveEstimate* estimate) {
  Shorten(kMaxTextBytes, &estimate->problem);
  Limit(kMaxNeeds, &estimate->needs);
  Limit(OverlapCounter::kMaxCameras, &estimate->cameras);
  Limit(size_t{kMaxMarkers}, &estimate->marker_positions_m);
  Limit(size_t{kMaxMarkers}, &estimate->wand_m);
  Limit(kMaxAdvice, &estimate->advice);
  for (LiveAdvice& advice : estimate->advice) {
    Shorten(kMaxTextBytes, &advice.text);
    Limit(OverlapCounter::kMaxCameras, &advice.cameras);
  }
  std::vector<LiveFigure>& history = estimate->history;
  if (history.size() > kMaxHistory) {
    history.erase(history.begin(), history.end() - static_cast<std::ptrdiff_t>(kMaxHistory));
  }
  if (!estimate->volume) return;
  LiveVolume& volume = *estimate->volume;
  const uint64_t points = uint64_t{volume.count_x} * volume.count_y * volume.count_z;
  if (points > kMaxVoxels || volume.sigma_mm.size() != points ||
      volume.wand_counts.size() != points) {
    // A grid that does not fit is worth nothing in part; the figures stay.
    volume.count_x = volume.count_y = volume.count_z = 0;
    volume.sigma_mm.clear();
    volume.wand_counts.clear();
  }
}

// Everything that a list of sessions shows.
SessionSummary SummaryOf(Session session) {
  SessionSummary summary;
  summary.camera_count = static_cast<uint32_t>(session.cameras.size());
  session.cameras.clear();
  session.requested_cameras.clear();
  session.missing_cameras.clear();
  summary.session = std::move(session);
  return summary;
}

bool SameFields(const Session& a, const Session& b) {
  return a.id == b.id && a.state == b.state && a.title == b.title &&
         a.start_utc_ns == b.start_utc_ns && a.stop_utc_ns == b.stop_utc_ns &&
         a.finish_utc_ns == b.finish_utc_ns && a.stop_reason == b.stop_reason &&
         a.observations_delete_utc_ns == b.observations_delete_utc_ns &&
         a.discard_utc_ns == b.discard_utc_ns;
}

bool SameCameras(const Session& a, const Session& b) {
  return std::ranges::equal(a.cameras, b.cameras, [](const auto& x, const auto& y) {
    return x.description == y.description && x.agent_id == y.agent_id;
  });
}

template <typename Part>
void Revise(Part part, uint64_t revision, Revised<Part>* revised, bool* changed) {
  if (revised->value && *revised->value == part) return;
  revised->value = std::make_shared<const Part>(std::move(part));
  revised->revision = revision;
  *changed = true;
}

}  // namespace

// What is followed of one rig. Used with update_mutex_ held.
struct LiveTracker::Rig {
  std::string name;
  LiveSnapshot state;
  std::optional<Session> session;
  bool reset = false;  // the session is another one than in `state`
  uint64_t late_count = 0;
  std::optional<Time> count_time;
  std::optional<Time> overlap_time;
  // Of the session's cameras, by name.
  std::map<std::string, CameraActivity> activities;
  std::vector<std::string> order;  // of the overlap's cameras
  std::unique_ptr<OverlapCounter> overlap;
  std::map<std::string, ClockRelation> clocks;                             // by clock_id
  std::map<std::string, std::pair<uint32_t, int64_t>> arrival_offsets_ns;  // with the clock epoch
  bool common_timebase = false;
  std::shared_ptr<const LiveEstimate> estimate;
  bool estimate_changed = false;
  std::vector<AgentRecord> agents;
  std::map<std::string, std::pair<std::string, CameraDescription>> connected;  // with the agent
  AlertBook alerts;
  std::optional<Time> commit_time;  // of the newest observation
  std::optional<Time> stop_time;    // the goal has stopped it then

  bool capturing() const { return session && session->state == SessionState::kCapturing; }
  // Rig time minus camera time, nanoseconds.
  std::optional<int64_t> OffsetNs(const SessionCamera& camera, uint32_t clock_epoch) const {
    const std::string& name_of = camera.description.camera;
    std::optional<int64_t> offset_ns;
    if (common_timebase) {
      offset_ns = 0;
    } else if (const auto clock = clocks.find(camera.description.clock.clock_id);
               clock != clocks.end() && clock->second.OffsetNs()) {
      offset_ns = clock->second.OffsetNs();
    } else if (const auto found = arrival_offsets_ns.find(name_of);
               found != arrival_offsets_ns.end() && found->second.first == clock_epoch) {
      offset_ns = found->second.second;
    }
    if (!offset_ns) return std::nullopt;
    *offset_ns -= std::llround(camera.description.latency_s * 1e9);
    if (const LiveEstimatedCamera* estimated = Estimated(name_of)) {
      *offset_ns += std::llround(std::clamp(estimated->time_offset_s, -10.0, 10.0) * 1e9);
    }
    return offset_ns;
  }
  const LiveEstimatedCamera* Estimated(const std::string& camera) const {
    if (!estimate) return nullptr;
    const auto found = std::ranges::find(estimate->cameras, camera, &LiveEstimatedCamera::camera);
    return found == estimate->cameras.end() ? nullptr : &*found;
  }
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
  auto rig = std::make_unique<Rig>();
  rig->name = name;
  rig->state.incarnation = IncarnationOf(name);
  rig->state.rig = name;
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
  for (const auto& [name, rig] : rigs_) MakeState(rig.get());
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
    } else if (rig->session) {
      FollowSession(rig.get(), rig->session->id);
    }
  }
}

void LiveTracker::FollowSession(Rig* rig, std::string_view id) {
  const absl::StatusOr<Session> session = store_->GetSession(id);
  const bool gone = !session.ok();
  const bool same = !gone && rig->session && rig->session->id == session->id &&
                    SameCameras(*rig->session, *session);
  if (same) {
    rig->session = *session;
    return;
  }
  if (gone && !rig->session) return;
  rig->activities.clear();
  rig->order.clear();
  rig->overlap.reset();
  rig->clocks.clear();
  rig->arrival_offsets_ns.clear();
  rig->estimate.reset();
  rig->alerts.Clear();
  rig->stop_time.reset();
  rig->count_time.reset();
  rig->commit_time.reset();
  rig->late_count = 0;
  // Parts that are not there any more cannot be told otherwise.
  rig->reset = true;
  rig->state.session = {};
  rig->state.overlap = {};
  rig->state.estimate = {};
  rig->state.goal = {};
  rig->session.reset();
  if (gone) return;
  rig->session = *session;
  rig->common_timebase = HaveCommonTimebase(*session);
  const Time now = Now();
  for (const SessionCamera& camera : session->cameras) {
    if (rig->order.size() == OverlapCounter::kMaxCameras) break;
    rig->order.push_back(camera.description.camera);
    rig->activities.try_emplace(camera.description.camera, camera.description, session->target,
                                now);
  }
  rig->overlap = std::make_unique<OverlapCounter>(rig->order.size());
  // Since the tracker began it has counted itself.
  if (session->state == SessionState::kCapturing && session->start_utc_ns >= begin_utc_ns_) {
    ReadEarlier(*rig, {});
    return;
  }
  const auto counts = store_->GetSessionCounts(id);
  if (!counts.ok()) return;
  for (const SessionCameraCounts& camera : *counts) {
    rig->late_count += camera.late_count;
    const auto found = rig->activities.find(camera.camera);
    if (found != rig->activities.end()) found->second.SetStored(camera);
  }
  if (session->state == SessionState::kCapturing) ReadEarlier(*rig, *counts);
}

void LiveTracker::ReadEarlier(const Rig& rig, const std::vector<SessionCameraCounts>& own_counts) {
  EarlierWaves waves{.session = *rig.session, .now_utc_ns = UtcNow()};
  for (const SessionCameraCounts& camera : own_counts) {
    for (const StreamStatus& stream : camera.streams) {
      if (stream.durable_seq == 0) continue;
      waves.own_until[{camera.camera, stream.stream_epoch}] = stream.durable_seq;
    }
  }
  if (waves.own_until.empty() && waves.session.continues.empty()) return;
  // Whoever collects rows keeps them, also while the rig shows another session.
  const bool tapped = !read_sessions_.insert(waves.session.id).second;
  reading_.Post([this, waves = std::move(waves), tapped] {
    EarlierRowTap tap;
    if (earlier_tap_ && !tapped) {
      tap = [&](const SessionCamera& camera, const ObservationBatch& rows) {
        earlier_tap_(waves.session.id, camera, rows);
      };
    }
    absl::StatusOr<EarlierCounts> counts = ReadEarlierWaves(*store_, waves, stopping_, tap);
    if (!counts.ok()) return;  // the server ends
    const std::lock_guard lock(mutex_);
    earlier_.insert_or_assign(waves.session.id, *std::move(counts));
  });
}

void LiveTracker::TakeEarlier() {
  std::map<std::string, EarlierCounts, std::less<>> earlier;
  {
    const std::lock_guard lock(mutex_);
    earlier.swap(earlier_);
  }
  for (const auto& [name, rig] : rigs_) {
    if (!rig->session || rig->overlap == nullptr) continue;
    const auto found = earlier.find(rig->session->id);
    if (found == earlier.end()) continue;
    for (const auto& [camera, coverage] : found->second.coverage) {
      const auto activity = rig->activities.find(camera);
      if (activity != rig->activities.end()) activity->second.AddCoverage(coverage);
    }
    rig->overlap->Add(found->second.overlap);
  }
}

void LiveTracker::FollowAgents() {
  std::map<std::string, std::vector<AgentRecord>> by_rig;
  for (AgentRecord& agent : directory_->List("")) by_rig[agent.rig].push_back(std::move(agent));
  for (const auto& [rig, agents] : by_rig) FindOrAddRig(rig);
  for (const auto& [name, rig] : rigs_) {
    rig->agents = std::move(by_rig[name]);
    rig->connected.clear();
    for (const AgentRecord& agent : rig->agents) {
      if (!agent.connected) continue;
      for (const AnnouncedCamera& camera : agent.cameras) {
        rig->connected.insert_or_assign(camera.description.camera,
                                        std::pair(agent.agent_id, camera.description));
      }
    }
  }
}

void LiveTracker::TakeArrivals(std::vector<std::pair<StreamKey, Arrivals>> arrivals) {
  const Time now = Now();
  const int64_t utc_ns = UtcNow();
  std::map<std::string_view, Rig*> by_session;
  for (const auto& [name, rig] : rigs_) {
    if (rig->session) by_session[rig->session->id] = rig.get();
  }
  for (const auto& [stream, arrived] : arrivals) {
    const auto found = by_session.find(stream.session_id);
    if (found == by_session.end()) continue;
    Rig& rig = *found->second;
    const auto activity = rig.activities.find(stream.camera);
    if (activity == rig.activities.end()) continue;
    activity->second.Add(stream.stream_epoch, arrived, now);
    const SessionCamera* const camera = rig.session->FindCamera(stream.camera);
    ClockRelation& clock = rig.clocks[camera->description.clock.clock_id];
    for (const auto& [epoch, sample] : arrived.clock_samples) clock.AddSample(epoch, sample);
    for (const HostAlignment& alignment : arrived.host_alignments) clock.AddAlignment(alignment);
    if (!arrived.has_rows) continue;
    if (!rig.commit_time || arrived.last_time > *rig.commit_time) {
      rig.commit_time = arrived.last_time;
    }
    // By arrival: the row that took least.
    const int64_t offset_ns =
        utc_ns - std::clamp<int64_t>(arrived.newest_row_ns, -(int64_t{1} << 61), int64_t{1} << 61);
    const auto [entry, inserted] = rig.arrival_offsets_ns.try_emplace(
        stream.camera, std::pair(arrived.clock_epoch, offset_ns));
    if (!inserted &&
        (entry->second.first != arrived.clock_epoch || entry->second.second > offset_ns)) {
      entry->second = {arrived.clock_epoch, offset_ns};
    }
  }
  // When all offsets of this update are known.
  for (const auto& [stream, arrived] : arrivals) {
    const auto found = by_session.find(stream.session_id);
    if (found != by_session.end()) CountOverlap(found->second, stream.camera, arrived.rows);
  }
}

void LiveTracker::CountOverlap(Rig* rig, const std::string& camera,
                               const std::vector<ThinnedRow>& rows) {
  const auto place = std::ranges::find(rig->order, camera);
  const SessionCamera* const own = rig->session->FindCamera(camera);
  if (rows.empty() || place == rig->order.end() || own == nullptr) return;
  std::vector<int64_t> newest_ns;
  for (const SessionCamera& other : rig->session->cameras) {
    const auto activity = rig->activities.find(other.description.camera);
    if (activity == rig->activities.end() || !activity->second.newest_row_ns()) continue;
    const auto offset_ns = rig->OffsetNs(other, activity->second.clock_epoch());
    if (offset_ns) newest_ns.push_back(*activity->second.newest_row_ns() + *offset_ns);
  }
  if (newest_ns.empty()) return;
  const int64_t limit_ns = LowerMedian(std::move(newest_ns)) + kMostAheadNs;
  const auto half_ns = static_cast<int64_t>(0.5e9 * rig->activities.at(camera).SpacingS());
  for (const ThinnedRow& row : rows) {
    if (row.visible_mask == 0) continue;
    const auto offset_ns = rig->OffsetNs(*own, row.clock_epoch);
    if (!offset_ns) continue;
    const int64_t time_ns = row.time_ns + *offset_ns;
    if (time_ns > limit_ns) continue;
    rig->overlap->Add(static_cast<size_t>(place - rig->order.begin()), time_ns - half_ns,
                      time_ns + half_ns);
  }
}

void LiveTracker::TakeEstimates() {
  std::map<std::string, std::shared_ptr<const LiveEstimate>, std::less<>> estimates;
  {
    const std::lock_guard lock(mutex_);
    estimates.swap(estimates_);
  }
  for (const auto& [name, rig] : rigs_) {
    if (!rig->session) continue;
    const auto found = estimates.find(rig->session->id);
    if (found == estimates.end()) continue;
    rig->estimate = found->second;
    rig->estimate_changed = true;
  }
}

LiveCamera LiveTracker::CameraOf(const Rig& rig, const std::string& name) const {
  LiveCamera camera;
  camera.camera = name;
  const auto connected = rig.connected.find(name);
  const SessionCamera* const own = rig.session ? rig.session->FindCamera(name) : nullptr;
  const auto activity = rig.activities.find(name);
  const bool is_connected =
      connected != rig.connected.end() &&
      (own == nullptr || own->agent_id.empty() || own->agent_id == connected->second.first);
  if (connected != rig.connected.end()) {
    camera.agent_id = connected->second.first;
    camera.image_size_px = connected->second.second.image_size_px;
  }
  camera.state = is_connected ? LiveCameraState::kIdle : LiveCameraState::kOffline;
  if (own != nullptr) {
    camera.agent_id = own->agent_id;
    camera.image_size_px = own->description.image_size_px;
  }
  if (own == nullptr || activity == rig.activities.end()) return camera;
  activity->second.Describe(Now(), &camera);
  const bool by_hand = own->agent_id.empty();
  const SessionState state = rig.session->state;
  if (state == SessionState::kCapturing || state == SessionState::kDraining) {
    if (activity->second.ended()) {
      camera.state = LiveCameraState::kEnded;
    } else if (is_connected || by_hand) {
      camera.state = LiveCameraState::kCapturing;
    }
  } else if (by_hand && state == SessionState::kFinished) {
    camera.state = LiveCameraState::kEnded;
  }
  camera.has_preview = is_connected && !by_hand && camera.state == LiveCameraState::kCapturing;
  const auto clock = rig.clocks.find(own->description.clock.clock_id);
  if (clock != rig.clocks.end()) camera.clock.sample_spread_s = clock->second.SpreadS();
  if (const LiveEstimatedCamera* estimated = rig.Estimated(name)) {
    camera.clock.time_offset_s = estimated->time_offset_s;
    camera.clock.time_offset_sigma_s = estimated->time_offset_sigma_s;
    camera.reprojection_rms_px = estimated->reprojection_rms_px;
  }
  const auto place = std::ranges::find(rig.order, name);
  camera.shared_instant_count = static_cast<uint32_t>(
      std::lround(rig.overlap->SharedS(static_cast<size_t>(place - rig.order.begin())) /
                  std::max(activity->second.SpacingS(), 1e-9 * OverlapCounter::kStepNs)));
  camera.shared_instant_goal = kSharedInstantGoal;
  return camera;
}

std::vector<AlertCondition> LiveTracker::ConditionsOf(const Rig& rig) const {
  const Time now = Now();
  RigFacts facts{.capturing = rig.capturing(),
                 .disk_free_bytes = health_.free_bytes,
                 .disk_reserve_bytes = health_.reserve_bytes,
                 .disk_known = health_.free_bytes > 0 || health_.reserve_bytes > 0,
                 .store_problem = health_.problem};
  if (rig.estimate) {
    facts.estimate = rig.estimate->state;
    facts.estimate_problem = rig.estimate->problem;
  }
  std::vector<AlertCondition> conditions = RigConditions(facts);
  if (!rig.capturing()) return conditions;

  // How much later than its own time each camera's rows come, on the common scale.
  std::map<std::string, double> delays_s;
  for (const SessionCamera& camera : rig.session->cameras) {
    const auto activity = rig.activities.find(camera.description.camera);
    if (activity == rig.activities.end()) continue;
    LiveCamera described;
    activity->second.Describe(now, &described);
    const bool behind =
        static_cast<double>(described.backlog_count) > 10 + described.observation_rate_hz;
    // A recording that an agent plays again from its start is no wrong clock.
    const bool replayed = rig.common_timebase && activity->second.stream_count() > 1;
    const auto clock = rig.clocks.find(camera.description.clock.clock_id);
    std::optional<int64_t> offset_ns;
    if (rig.common_timebase) offset_ns = 0;
    if (!offset_ns && clock != rig.clocks.end()) offset_ns = clock->second.OffsetNs();
    const auto delay_s = activity->second.ArrivalDelayS();
    if (behind || replayed || !offset_ns || !delay_s) continue;
    delays_s[camera.description.camera] = *delay_s - 1e-9 * static_cast<double>(*offset_ns);
  }
  std::optional<double> reference_s;
  if (delays_s.size() >= 2) {
    std::vector<double> values;
    for (const auto& [camera, delay_s] : delays_s) values.push_back(delay_s);
    reference_s = LowerMedian(values);
    if (!rig.common_timebase && delays_s.size() == 2) {
      // Of two, the one nearer to the server's own clock.
      const double server_s = std::chrono::duration<double>(now.time_since_epoch()).count() -
                              1e-9 * static_cast<double>(UtcNow());
      reference_s = *std::ranges::min_element(
          values, {}, [&](double value) { return std::abs(value - server_s); });
    }
  }
  for (const SessionCamera& camera : rig.session->cameras) {
    const std::string& name = camera.description.camera;
    const auto activity = rig.activities.find(name);
    if (activity == rig.activities.end()) continue;
    CameraFacts camera_facts;
    activity->second.Describe(now, &camera_facts);
    camera_facts.agent_id = camera.agent_id;
    const auto connected = rig.connected.find(name);
    camera_facts.agent_connected =
        connected != rig.connected.end() && connected->second.first == camera.agent_id;
    const auto clock = rig.clocks.find(camera.description.clock.clock_id);
    if (clock != rig.clocks.end()) camera_facts.clock_jump = clock->second.jump();
    if (const auto delay = delays_s.find(name); delay != delays_s.end() && reference_s) {
      camera_facts.arrival_offset_s = delay->second - *reference_s;
    }
    if (const LiveEstimatedCamera* estimated = rig.Estimated(name)) {
      camera_facts.estimated_offset_s = estimated->time_offset_s;
      camera_facts.lens_disagrees = estimated->lens_disagrees;
    }
    for (AlertCondition& condition : CameraConditions(camera_facts)) {
      conditions.push_back(std::move(condition));
    }
  }
  return conditions;
}

void LiveTracker::MakeState(Rig* rig) {
  const Time now = Now();
  const int64_t utc_ns = UtcNow();
  const uint64_t revision = last_revision_ + 1;
  LiveSnapshot& state = rig->state;
  bool changed = rig->reset;
  if (rig->reset) state.full_since = revision;
  rig->reset = false;

  size_t seeing = 0;
  for (auto& [name, activity] : rig->activities) {
    activity.Advance(now);
    seeing += activity.sees_wand(now);
  }
  for (auto& [name, activity] : rig->activities) {
    activity.NoteWaving(rig->capturing() && seeing > (activity.sees_wand(now) ? 1U : 0U), now);
  }

  std::set<std::string> names(rig->order.begin(), rig->order.end());
  for (const auto& [name, camera] : rig->connected) {
    if (names.size() < OverlapCounter::kMaxCameras) names.insert(name);
  }
  uint64_t observation_count = 0;
  uint64_t wand_count = 0;
  for (const std::string& name : names) {
    LiveCamera camera = CameraOf(*rig, name);
    observation_count += camera.observation_count;
    wand_count += camera.wand_count;
    Revise(std::move(camera), revision, &state.cameras[name], &changed);
  }
  for (auto camera = state.cameras.begin(); camera != state.cameras.end();) {
    if (names.contains(camera->first)) {
      ++camera;
      continue;
    }
    state.removed_cameras.emplace_back(revision, camera->first);
    camera = state.cameras.erase(camera);
    changed = true;
  }
  std::erase_if(state.removed_cameras,
                [&](const auto& removed) { return names.contains(removed.second); });
  if (state.removed_cameras.size() > kMaxRemoved) {
    state.removed_cameras.clear();
    state.full_since = revision;
    changed = true;
  }

  if (rig->session) {
    SessionSummary summary = SummaryOf(*rig->session);
    const bool new_fields =
        !state.session.value || !SameFields(state.session.value->session, summary.session);
    const bool new_counts =
        state.session.value && (state.session.value->observation_count != observation_count ||
                                state.session.value->wand_count != wand_count);
    if (new_fields ||
        (new_counts && (!rig->count_time || now - *rig->count_time >= kCountInterval))) {
      rig->count_time = now;
      summary.observation_count = observation_count;
      summary.wand_count = wand_count;
      summary.late_count = rig->late_count;
      state.session = {std::make_shared<const SessionSummary>(std::move(summary)), revision};
      changed = true;
    }
  }
  if (rig->overlap && !rig->order.empty() &&
      (!state.overlap.value || !rig->overlap_time ||
       now - *rig->overlap_time >= kOverlapInterval)) {
    rig->overlap_time = now;
    LiveOverlap overlap{.cameras = rig->order};
    std::vector<double> spacings_s;
    for (const std::string& name : rig->order) {
      spacings_s.push_back(rig->activities.at(name).SpacingS());
    }
    for (size_t a = 0; a < rig->order.size(); ++a) {
      for (size_t b = a + 1; b < rig->order.size(); ++b) {
        const double spacing_s =
            std::max({spacings_s[a], spacings_s[b], 1e-9 * OverlapCounter::kStepNs});
        overlap.counts.push_back(
            static_cast<uint32_t>(std::lround(rig->overlap->PairS(a, b) / spacing_s)));
      }
    }
    Revise(std::move(overlap), revision, &state.overlap, &changed);
  }
  if (rig->estimate_changed && rig->estimate) {
    state.estimate = {rig->estimate, revision};
    changed = true;
  }
  rig->estimate_changed = false;
  std::vector<AlertCondition> conditions = ConditionsOf(*rig);
  for (AlertCondition& condition : conditions) Shorten(kMaxAlertBytes, &condition.text);
  Revise(rig->alerts.Update(std::move(conditions), now, utc_ns), revision, &state.alerts, &changed);
  std::vector<LiveAgent> agents;
  for (const AgentRecord& agent : rig->agents) {
    LiveAgent live{.agent_id = agent.agent_id,
                   .host = agent.host,
                   .connected = agent.connected,
                   .software_version = agent.software_version};
    Shorten(kMaxHostBytes, &live.host);
    Shorten(kMaxVersionBytes, &live.software_version);
    if (agent.spool) {
      live.spool_rows = agent.spool->row_count;
      live.spool_bytes = agent.spool->bytes;
      live.spool_limit_bytes = agent.spool->limit_bytes;
    }
    agents.push_back(std::move(live));
  }
  Revise(std::move(agents), revision, &state.agents, &changed);

  if (rig->session && rig->session->goal) {
    const Session& session = *rig->session;
    LiveGoal goal;
    if (rig->capturing()) {
      const double elapsed_s = 1e-9 * static_cast<double>(utc_ns - session.start_utc_ns);
      goal = JudgeGoal(*session.goal, session, rig->estimate.get(), elapsed_s, utc_ns);
      if (goal.reached) StopAtGoal(rig, goal);
    } else {
      goal.until_mm = session.goal->until_mm;
      if (rig->estimate && rig->estimate->volume) goal.now_mm = rig->estimate->volume->p95_mm;
      goal.reached = !session.stop_reason.empty();
      if (!goal.reached) {
        goal.why_not = session.state == SessionState::kCreated ? "it has not been started"
                                                               : "it was stopped before";
      }
    }
    Revise(std::move(goal), revision, &state.goal, &changed);
  }

  if (!changed) return;
  last_revision_ = revision;
  state.revision = revision;
  state.time_utc_ns = utc_ns;
  state.age_s =
      rig->commit_time ? std::chrono::duration<double>(now - *rig->commit_time).count() : 0;
  auto published = std::make_shared<const LiveSnapshot>(state);
  const std::lock_guard lock(mutex_);
  published_.insert_or_assign(rig->name, std::move(published));
}

void LiveTracker::StopAtGoal(Rig* rig, const LiveGoal& goal) {
  const Time now = Now();
  // It stays as it is until the coordinator has stopped it; after an error it is tried again.
  if (rig->stop_time && now - *rig->stop_time < seconds(2)) return;
  rig->stop_time = now;
  stops_.Post([this, id = rig->session->id, reason = StopReason(goal)] {
    const auto stopped = coordinator_->StopSession(id, 0, reason);
    if (!stopped.ok()) {
      spdlog::warn("session {} has reached its goal and cannot be stopped: {}", id,
                   std::string(stopped.status().message()));
    }
  });
}

}  // namespace rigcal::server
