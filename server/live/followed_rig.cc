// SPDX-License-Identifier: Apache-2.0
#include "server/live/followed_rig.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "absl/container/flat_hash_map.h"
#include "common/statistics/robust_statistics.h"
#include "server/live/live_limits.h"

namespace rigcal::server {
namespace {

// Clocks that agree to this with the wand's light code keep what is known of them otherwise.
constexpr int64_t kLightAgreesNs = 20'000'000;
// Of a camera's clock and of a wand's: sums of what is beyond may not be within 64 bits.
constexpr int64_t kMostDeviceNs = int64_t{1} << 61, kMostLightNs = int64_t{1} << 50;

bool IsPlausible(const ClockSample& sample) {
  return sample.device_ns > -kMostDeviceNs && sample.device_ns < kMostDeviceNs &&
         sample.light_ns >= 0 && sample.light_ns < kMostLightNs;
}

// Wanted of each camera; a dashboard shows it as a bar. It ends no session.
constexpr uint32_t kSharedInstantGoal = 200;
// A camera whose times are further ahead than this is not compared with others: one wrong clock
// must not hide the rest.
constexpr int64_t kMostAheadNs = 15'000'000'000;

bool SameCameras(const Session& a, const Session& b) {
  return std::ranges::equal(a.cameras, b.cameras, [](const auto& x, const auto& y) {
    return x.description == y.description && x.agent_id == y.agent_id;
  });
}

}  // namespace

bool FollowedRig::Follow(const Session& session, Time now) {
  if (session_ && session_->id == session.id && SameCameras(*session_, session)) {
    session_ = session;
    return false;
  }
  ForgetSession();
  session_ = session;
  common_timebase_ = HaveCommonTimebase(session);
  for (const SessionCamera& camera : session.cameras) {
    if (order_.size() == OverlapCounter::kMaxCameras) break;
    order_.push_back(camera.description.camera);
    activities_.try_emplace(camera.description.camera, camera.description, session.target, now);
  }
  overlap_ = std::make_unique<OverlapCounter>(order_.size());
  return true;
}

void FollowedRig::ForgetSession() {
  session_.reset();
  common_timebase_ = false;
  order_.clear();
  activities_.clear();
  overlap_.reset();
  clocks_.clear();
  wand_times_.clear();
  arrival_offsets_ns_.clear();
  estimate_.reset();
  late_count_ = 0;
  commit_time_.reset();
}

void FollowedRig::SetStored(const std::vector<SessionCameraCounts>& counts) {
  for (const SessionCameraCounts& camera : counts) {
    late_count_ += camera.late_count;
    const auto found = activities_.find(camera.camera);
    if (found != activities_.end()) found->second.SetStored(camera);
  }
}

void FollowedRig::AddEarlier(const EarlierCounts& earlier) {
  if (overlap_ == nullptr) return;
  for (const auto& [camera, coverage] : earlier.coverage) {
    const auto activity = activities_.find(camera);
    if (activity != activities_.end()) activity->second.AddCoverage(coverage);
  }
  // Before its first row here: common time is shown as a number of rows.
  for (const auto& [camera, spacing] : earlier.spacing) {
    const auto activity = activities_.find(camera);
    if (activity != activities_.end()) activity->second.SetEarlierSpacing(spacing);
  }
  overlap_->Add(earlier.overlap);
}

void FollowedRig::SetAgents(std::vector<AgentRecord> agents) {
  agents_ = std::move(agents);
  connected_.clear();
  for (const AgentRecord& agent : agents_) {
    if (!agent.connected) continue;
    for (const AnnouncedCamera& camera : agent.cameras) {
      connected_.insert_or_assign(camera.description.camera,
                                  ConnectedCamera{agent.agent_id, camera.description});
    }
  }
}

void FollowedRig::AddArrivals(const StreamKey& stream, const Arrivals& arrived, Time now,
                              int64_t utc_ns) {
  const auto activity = activities_.find(stream.camera);
  if (activity == activities_.end()) return;
  activity->second.Add(stream.stream_epoch, arrived, now);
  ClockRelation& clock = clocks_[session_->FindCamera(stream.camera)->description.clock.clock_id];
  for (const auto& [epoch, sample] : arrived.clock_samples) {
    clock.AddSample(epoch, sample);
    if (sample.IsOfWand() && IsPlausible(sample)) wand_times_[stream.camera] = {epoch, sample};
  }
  for (const HostAlignment& alignment : arrived.host_alignments) clock.AddAlignment(alignment);
  if (!arrived.has_rows) return;
  if (!commit_time_ || arrived.last_time > *commit_time_) commit_time_ = arrived.last_time;
  // By arrival: the row that took least.
  const int64_t offset_ns =
      utc_ns - std::clamp<int64_t>(arrived.newest_row_ns, -(int64_t{1} << 61), int64_t{1} << 61);
  const auto [entry, inserted] =
      arrival_offsets_ns_.try_emplace(stream.camera, std::pair(arrived.clock_epoch, offset_ns));
  if (!inserted &&
      (entry->second.first != arrived.clock_epoch || entry->second.second > offset_ns)) {
    entry->second = {arrived.clock_epoch, offset_ns};
  }
}

void FollowedRig::CountOverlap(const std::vector<std::pair<StreamKey, Arrivals>>& arrived) {
  if (!session_) return;
  const std::optional<int64_t> limit_ns = NewestComparedNs();
  if (!limit_ns) return;
  absl::flat_hash_map<std::string_view, size_t> places;
  for (size_t i = 0; i < order_.size(); ++i) places[order_[i]] = i;
  for (const auto& [stream, arrivals] : arrived) {
    if (stream.session_id != session_->id) continue;
    const auto place = places.find(stream.camera);
    if (place != places.end()) CountOverlapOf(place->second, arrivals.rows, *limit_ns);
  }
}

std::optional<int64_t> FollowedRig::NewestComparedNs() const {
  std::vector<int64_t> newest_ns;
  for (const SessionCamera& camera : session_->cameras) {
    const auto activity = activities_.find(camera.description.camera);
    if (activity == activities_.end() || !activity->second.newest_row_ns()) continue;
    const auto offset_ns = OffsetNs(camera, activity->second.clock_epoch());
    if (offset_ns) newest_ns.push_back(*activity->second.newest_row_ns() + *offset_ns);
  }
  if (newest_ns.empty()) return std::nullopt;
  return LowerMedian(std::move(newest_ns)) + kMostAheadNs;
}

void FollowedRig::CountOverlapOf(size_t place, const std::vector<ThinnedRow>& rows,
                                 int64_t limit_ns) {
  const SessionCamera* const camera = session_->FindCamera(order_[place]);
  if (rows.empty() || camera == nullptr) return;
  const auto half_ns = static_cast<int64_t>(0.5e9 * activities_.at(order_[place]).SpacingS());
  uint32_t clock_epoch = rows.front().clock_epoch;
  std::optional<int64_t> offset_ns = OffsetNs(*camera, clock_epoch);
  for (const ThinnedRow& row : rows) {
    if (row.visible_mask == 0) continue;
    if (row.clock_epoch != clock_epoch) {
      clock_epoch = row.clock_epoch;
      offset_ns = OffsetNs(*camera, clock_epoch);
    }
    if (!offset_ns) continue;
    const int64_t time_ns = row.time_ns + *offset_ns;
    if (time_ns > limit_ns) continue;
    overlap_->Add(place, time_ns - half_ns, time_ns + half_ns);
  }
}

void FollowedRig::Advance(Time now) {
  size_t seeing = 0;
  for (auto& [name, activity] : activities_) {
    activity.Advance(now);
    seeing += activity.sees_wand(now);
  }
  for (auto& [name, activity] : activities_) {
    activity.NoteWaving(capturing() && seeing > (activity.sees_wand(now) ? 1U : 0U), now);
  }
}

const ClockRelation* FollowedRig::FindClock(const SessionCamera& camera) const {
  const auto clock = clocks_.find(camera.description.clock.clock_id);
  return clock == clocks_.end() ? nullptr : &clock->second;
}

const LiveEstimatedCamera* FollowedRig::FindEstimated(const std::string& camera) const {
  if (!estimate_) return nullptr;
  const auto found = std::ranges::find(estimate_->cameras, camera, &LiveEstimatedCamera::camera);
  return found == estimate_->cameras.end() ? nullptr : &*found;
}

std::optional<int64_t> FollowedRig::CoarseOffsetNs(const SessionCamera& camera,
                                                   uint32_t clock_epoch) const {
  if (common_timebase_) return 0;
  if (const ClockRelation* clock = FindClock(camera); clock && clock->OffsetNs()) {
    return clock->OffsetNs();
  }
  const auto found = arrival_offsets_ns_.find(camera.description.camera);
  if (found == arrival_offsets_ns_.end() || found->second.first != clock_epoch) return std::nullopt;
  return found->second.second;
}

std::optional<int64_t> FollowedRig::LightOffsetNs(const SessionCamera& camera,
                                                  uint32_t clock_epoch) const {
  const auto own = wand_times_.find(camera.description.camera);
  if (own == wand_times_.end() || own->second.first != clock_epoch) return std::nullopt;
  const ClockSample& read = own->second.second;
  for (const std::string& name : order_) {
    const auto other = wand_times_.find(name);
    if (other == wand_times_.end() || other->second.second.light != read.light) continue;
    if (other == own) return std::nullopt;
    const SessionCamera* const reference = session_->FindCamera(name);
    const auto reference_ns =
        reference == nullptr ? std::nullopt : CoarseOffsetNs(*reference, other->second.first);
    if (!reference_ns) continue;
    const ClockSample& there = other->second.second;
    return *reference_ns + (there.device_ns - read.device_ns) + (read.light_ns - there.light_ns);
  }
  return std::nullopt;
}

std::optional<int64_t> FollowedRig::OffsetNs(const SessionCamera& camera,
                                             uint32_t clock_epoch) const {
  const std::string& name = camera.description.camera;
  std::optional<int64_t> offset_ns = CoarseOffsetNs(camera, clock_epoch);
  if (const auto by_light_ns = LightOffsetNs(camera, clock_epoch);
      by_light_ns && (!offset_ns || std::abs(static_cast<double>(*by_light_ns) -
                                             static_cast<double>(*offset_ns)) > kLightAgreesNs)) {
    offset_ns = by_light_ns;
  }
  if (!offset_ns) return std::nullopt;
  *offset_ns -= std::llround(camera.description.latency_s * 1e9);
  if (const LiveEstimatedCamera* estimated = FindEstimated(name)) {
    *offset_ns += std::llround(std::clamp(estimated->time_offset_s, -10.0, 10.0) * 1e9);
  }
  return offset_ns;
}

LiveCamera FollowedRig::DescribeCamera(const std::string& name, Time now) const {
  LiveCamera camera;
  camera.camera = name;
  const auto connected = connected_.find(name);
  const SessionCamera* const own = session_ ? session_->FindCamera(name) : nullptr;
  const auto activity = activities_.find(name);
  const bool is_connected =
      connected != connected_.end() &&
      (own == nullptr || own->agent_id.empty() || own->agent_id == connected->second.agent_id);
  if (connected != connected_.end()) {
    camera.agent_id = connected->second.agent_id;
    camera.image_size_px = connected->second.description.image_size_px;
  }
  camera.state = is_connected ? LiveCameraState::kIdle : LiveCameraState::kOffline;
  if (own != nullptr) {
    camera.agent_id = own->agent_id;
    camera.image_size_px = own->description.image_size_px;
  }
  if (own == nullptr || activity == activities_.end()) return camera;
  activity->second.Describe(now, &camera);
  const bool by_hand = own->agent_id.empty();
  const SessionState state = session_->state;
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
  if (const ClockRelation* clock = FindClock(*own)) camera.clock.sample_spread_s = clock->SpreadS();
  if (const auto read = wand_times_.find(name); read != wand_times_.end()) {
    const ClockSample& sample = read->second.second;
    camera.clock.wand = sample.light;
    camera.clock.wand_time_s = 1e-9 * static_cast<double>(sample.light_ns);
  }
  if (const LiveEstimatedCamera* estimated = FindEstimated(name)) {
    camera.clock.time_offset_s = estimated->time_offset_s;
    camera.clock.time_offset_sigma_s = estimated->time_offset_sigma_s;
    camera.reprojection_rms_px = estimated->reprojection_rms_px;
  }
  const auto place = std::ranges::find(order_, name);
  camera.shared_instant_count = static_cast<uint32_t>(
      std::lround(overlap_->SharedS(static_cast<size_t>(place - order_.begin())) /
                  std::max(activity->second.SpacingS(), 1e-9 * OverlapCounter::kStepNs)));
  camera.shared_instant_goal = kSharedInstantGoal;
  return camera;
}

LiveOverlap FollowedRig::DescribeOverlap() const {
  if (order_.size() > kMaxCamerasInOverlap) return {};
  LiveOverlap described{.cameras = order_};
  std::vector<double> spacings_s;
  for (const std::string& name : order_) spacings_s.push_back(activities_.at(name).SpacingS());
  for (size_t a = 0; a < order_.size(); ++a) {
    for (size_t b = a + 1; b < order_.size(); ++b) {
      const double spacing_s =
          std::max({spacings_s[a], spacings_s[b], 1e-9 * OverlapCounter::kStepNs});
      described.counts.push_back(
          static_cast<uint32_t>(std::lround(overlap_->PairS(a, b) / spacing_s)));
    }
  }
  return described;
}

}  // namespace rigcal::server
