// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/live_answers.h"

#include <charconv>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/wire/camera_wire.h"
#include "common/wire/session_wire.h"
#include "common/wire/time_wire.h"

namespace rigcal::server {
namespace {

static_assert(static_cast<int>(LiveCameraState::kOffline) == v1::LiveCamera::STATE_OFFLINE);
static_assert(static_cast<int>(LiveCameraState::kIdle) == v1::LiveCamera::STATE_IDLE);
static_assert(static_cast<int>(LiveCameraState::kCapturing) == v1::LiveCamera::STATE_CAPTURING);
static_assert(static_cast<int>(LiveCameraState::kEnded) == v1::LiveCamera::STATE_ENDED);
static_assert(static_cast<int>(EstimateState::kWaiting) == v1::LiveEstimate::STATE_WAITING);
static_assert(static_cast<int>(EstimateState::kReady) == v1::LiveEstimate::STATE_READY);
static_assert(static_cast<int>(EstimateState::kFailed) == v1::LiveEstimate::STATE_FAILED);
static_assert(static_cast<int>(AlertSeverity::kInfo) == v1::LiveAlert::SEVERITY_INFO);
static_assert(static_cast<int>(AlertSeverity::kWarning) == v1::LiveAlert::SEVERITY_WARNING);
static_assert(static_cast<int>(AlertSeverity::kError) == v1::LiveAlert::SEVERITY_ERROR);

static_assert(static_cast<int>(MonitorMode::kOff) == v1::MONITOR_MODE_OFF);
static_assert(static_cast<int>(MonitorMode::kWatch) == v1::MONITOR_MODE_WATCH);
static_assert(static_cast<int>(MonitorMode::kRepair) == v1::MONITOR_MODE_REPAIR);
static_assert(static_cast<int>(MonitorVerdict::kUnknown) ==
              v1::LiveMonitoredCamera::VERDICT_UNKNOWN);
static_assert(static_cast<int>(MonitorVerdict::kGood) == v1::LiveMonitoredCamera::VERDICT_GOOD);
static_assert(static_cast<int>(MonitorVerdict::kMoved) == v1::LiveMonitoredCamera::VERDICT_MOVED);
static_assert(static_cast<int>(MonitorRepairState::kNone) == v1::LiveMonitor::REPAIR_STATE_NONE);
static_assert(static_cast<int>(MonitorRepairState::kNotActive) ==
              v1::LiveMonitor::REPAIR_STATE_NOT_ACTIVE);

// Answers for one state that are kept: everybody polls, so almost all ask for the last few.
constexpr size_t kMaxAnswers = 64;
constexpr size_t kMaxRigs = 128;

void Fill(const LiveCamera& camera, v1::LiveCamera* proto) {
  proto->set_camera(camera.camera);
  proto->set_agent_id(camera.agent_id);
  proto->set_state(static_cast<v1::LiveCamera::State>(camera.state));
  *proto->mutable_image_size_px() = wire::ToProto(camera.image_size_px);
  proto->set_observation_rate_hz(camera.observation_rate_hz);
  proto->set_wand_rate_hz(camera.wand_rate_hz);
  proto->set_observation_count(camera.observation_count);
  proto->set_wand_count(camera.wand_count);
  proto->set_backlog_count(camera.backlog_count);
  proto->set_dropped_count(camera.dropped_count);
  v1::LiveClock* clock = proto->mutable_clock();
  if (camera.clock.time_offset_s) clock->set_time_offset_s(*camera.clock.time_offset_s);
  clock->set_time_offset_sigma_s(camera.clock.time_offset_sigma_s);
  if (camera.clock.sample_spread_s) clock->set_sample_spread_s(*camera.clock.sample_spread_s);
  clock->set_clock_epoch_count(camera.clock.clock_epoch_count);
  clock->set_wand(camera.clock.wand);
  clock->set_wand_time_s(camera.clock.wand_time_s);
  v1::LiveCoverage* coverage = proto->mutable_coverage();
  coverage->set_columns(camera.coverage.columns);
  coverage->set_rows(camera.coverage.rows);
  coverage->set_counts(camera.coverage.counts);
  coverage->set_covered_share(camera.coverage.covered_share);
  for (const LiveTrailPoint& point : camera.trail) {
    v1::LiveTrailPoint* out = proto->add_trail();
    out->set_age_ms(point.age_ms);
    out->set_x0_px(point.x0_px);
    out->set_y0_px(point.y0_px);
    out->set_x1_px(point.x1_px);
    out->set_y1_px(point.y1_px);
  }
  proto->set_shared_instant_count(camera.shared_instant_count);
  proto->set_shared_instant_goal(camera.shared_instant_goal);
  proto->set_reprojection_rms_px(camera.reprojection_rms_px);
  proto->set_has_preview(camera.has_preview);
}

void Fill(const LiveVolume& volume, v1::LiveVolume* proto) {
  *proto->mutable_origin_m() = wire::ToProto(volume.origin_m);
  proto->set_step_m(volume.step_m);
  proto->set_count_x(volume.count_x);
  proto->set_count_y(volume.count_y);
  proto->set_count_z(volume.count_z);
  proto->mutable_sigma_mm()->Add(volume.sigma_mm.begin(), volume.sigma_mm.end());
  proto->mutable_wand_counts()->Add(volume.wand_counts.begin(), volume.wand_counts.end());
  proto->set_median_mm(volume.median_mm);
  proto->set_p95_mm(volume.p95_mm);
  proto->set_worst_mm(volume.worst_mm);
  *proto->mutable_worst_point_m() = wire::ToProto(volume.worst_point_m);
  proto->set_scale_sigma_rel(volume.scale_sigma_rel);
}

void Fill(const LiveEstimate& estimate, v1::LiveEstimate* proto) {
  proto->set_state(static_cast<v1::LiveEstimate::State>(estimate.state));
  if (estimate.time_utc_ns != 0) *proto->mutable_time() = wire::ToTimestamp(estimate.time_utc_ns);
  proto->set_problem(estimate.problem);
  for (const LivePairNeed& need : estimate.needs) {
    v1::LivePairNeed* out = proto->add_needs();
    out->set_camera_a(need.camera_a);
    out->set_camera_b(need.camera_b);
    out->set_common_count(need.common_count);
    out->set_needed_count(need.needed_count);
  }
  proto->set_instant_count(estimate.instant_count);
  proto->set_solve_duration_s(estimate.solve_duration_s);
  proto->set_scale_known(estimate.scale_known);
  proto->set_intrinsics_refined(estimate.intrinsics_refined);
  for (const LiveEstimatedCamera& camera : estimate.cameras) {
    v1::LiveEstimatedCamera* out = proto->add_cameras();
    out->set_camera(camera.camera);
    *out->mutable_cam_from_rig() = wire::ToProto(camera.cam_from_rig);
    out->set_time_offset_s(camera.time_offset_s);
    out->set_time_offset_sigma_s(camera.time_offset_sigma_s);
    out->set_reprojection_rms_px(camera.reprojection_rms_px);
    out->set_focal_length_px(camera.focal_length_px);
    out->set_lens_disagrees(camera.lens_disagrees);
  }
  proto->mutable_marker_positions_m()->Add(estimate.marker_positions_m.begin(),
                                           estimate.marker_positions_m.end());
  if (estimate.volume) Fill(*estimate.volume, proto->mutable_volume());
  for (const LiveFigure& figure : estimate.history) {
    v1::LiveFigure* out = proto->add_history();
    out->set_time_s(figure.time_s);
    out->set_p95_mm(figure.p95_mm);
  }
  if (estimate.held_out) {
    v1::LiveHeldOut* out = proto->mutable_held_out();
    out->set_rms_px(estimate.held_out->rms_px);
    out->set_expected_rms_px(estimate.held_out->expected_rms_px);
    out->set_agrees(estimate.held_out->agrees);
  }
  for (const LiveAdvice& advice : estimate.advice) {
    v1::LiveAdvice* out = proto->add_advice();
    out->set_text(advice.text);
    *out->mutable_point_m() = wire::ToProto(advice.point_m);
    for (const std::string& camera : advice.cameras) out->add_cameras(camera);
    out->set_expected_p95_mm(advice.expected_p95_mm);
  }
  for (const Eigen::Vector3d& point_m : estimate.wand_m) {
    *proto->add_wand_m() = wire::ToProto(point_m);
  }
}

void Fill(const LiveOverlap& overlap, v1::LiveOverlap* proto) {
  for (const std::string& camera : overlap.cameras) proto->add_cameras(camera);
  proto->mutable_counts()->Add(overlap.counts.begin(), overlap.counts.end());
}

void Fill(const std::vector<LiveAlert>& alerts, v1::LiveAlerts* proto) {
  for (const LiveAlert& alert : alerts) {
    v1::LiveAlert* out = proto->add_alerts();
    out->set_kind(alert.kind);
    out->set_severity(static_cast<v1::LiveAlert::Severity>(alert.severity));
    out->set_camera(alert.camera);
    out->set_text(alert.text);
    *out->mutable_since() = wire::ToTimestamp(alert.since_utc_ns);
  }
}

void Fill(const std::vector<LiveAgent>& agents, v1::LiveAgents* proto) {
  for (const LiveAgent& agent : agents) {
    v1::LiveAgent* out = proto->add_agents();
    out->set_agent_id(agent.agent_id);
    out->set_host(agent.host);
    out->set_connected(agent.connected);
    out->set_spool_rows(agent.spool_rows);
    out->set_spool_bytes(agent.spool_bytes);
    out->set_spool_limit_bytes(agent.spool_limit_bytes);
    out->set_software_version(agent.software_version);
  }
}

void Fill(const LiveGoal& goal, v1::LiveGoal* proto) {
  proto->set_until_mm(goal.until_mm);
  proto->set_now_mm(goal.now_mm);
  proto->set_reached(goal.reached);
  proto->set_why_not(goal.why_not);
}

void Fill(const LiveMonitor& monitor, v1::LiveMonitor* proto) {
  proto->set_mode(static_cast<v1::MonitorMode>(monitor.mode));
  proto->set_calibration_id(monitor.calibration_id);
  proto->set_session_id(monitor.session_id);
  if (monitor.time_utc_ns != 0) *proto->mutable_time() = wire::ToTimestamp(monitor.time_utc_ns);
  proto->set_problem(monitor.problem);
  proto->set_all_moved(monitor.all_moved);
  for (const LiveMonitoredCamera& camera : monitor.cameras) {
    v1::LiveMonitoredCamera* const out = proto->add_cameras();
    out->set_camera(camera.camera);
    out->set_verdict(static_cast<v1::LiveMonitoredCamera::Verdict>(camera.verdict));
    if (camera.time_utc_ns != 0) *out->mutable_time() = wire::ToTimestamp(camera.time_utc_ns);
    out->set_translation_m(camera.translation_m);
    out->set_translation_sigma_m(camera.translation_sigma_m);
    out->set_rotation_rad(camera.rotation_rad);
    out->set_rotation_sigma_rad(camera.rotation_sigma_rad);
    out->set_centre_px(camera.centre_px);
    out->set_centre_sigma_px(camera.centre_sigma_px);
    out->set_sigmas(camera.sigmas);
    out->set_time_offset_s(camera.time_offset_s);
    out->set_time_offset_sigma_s(camera.time_offset_sigma_s);
    out->set_clock_change_s(camera.clock_change_s);
    out->set_clock_change_sigma_s(camera.clock_change_sigma_s);
    out->set_clock_change_ppm(camera.clock_change_ppm);
    out->set_clock_changed(camera.clock_changed);
  }
  proto->set_repair(static_cast<v1::LiveMonitor::RepairState>(monitor.repair));
  proto->set_repair_id(monitor.repair_id);
  proto->set_repair_text(monitor.repair_text);
}

// The revision of `state` that `text` names; none: it is not one of this rig and this server.
std::optional<uint64_t> ReadRevision(const LiveSnapshot& state, std::string_view text) {
  if (text.size() <= state.incarnation.size() + 1 ||
      text.substr(0, state.incarnation.size()) != state.incarnation ||
      text[state.incarnation.size()] != '-') {
    return std::nullopt;
  }
  text.remove_prefix(state.incarnation.size() + 1);
  uint64_t revision = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), revision);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  if (revision > state.revision || revision < state.full_since) return std::nullopt;
  return revision;
}

const std::string& RigOf(const v1::GetLiveRequest& request) {
  static const auto* const kDefault = new std::string("rig");
  return request.rig().empty() ? *kDefault : request.rig();
}

}  // namespace

std::string RevisionOf(const LiveSnapshot& state) {
  return absl::StrCat(state.incarnation, "-", state.revision);
}

v1::LiveState ToProto(const LiveSnapshot& state, const std::optional<uint64_t>& since) {
  v1::LiveState proto;
  proto.set_revision(RevisionOf(state));
  const bool full = !since || *since < state.full_since;
  const uint64_t after = full ? 0 : *since;
  if (!full && after == state.revision) return proto;
  proto.set_full(full);
  *proto.mutable_time() = wire::ToTimestamp(state.time_utc_ns);
  proto.set_rig(state.rig);
  proto.set_age_s(state.age_s);
  const auto is_new = [&](const auto& part) {
    return part.value != nullptr && (full || part.revision > after);
  };
  if (is_new(state.session)) *proto.mutable_session() = wire::ToProto(*state.session.value);
  for (const auto& [name, camera] : state.cameras) {
    if (is_new(camera)) Fill(*camera.value, proto.add_cameras());
  }
  for (const auto& [revision, camera] : state.removed_cameras) {
    if (!full && revision > after) proto.add_removed_cameras(camera);
  }
  if (is_new(state.overlap)) Fill(*state.overlap.value, proto.mutable_overlap());
  if (is_new(state.estimate)) Fill(*state.estimate.value, proto.mutable_estimate());
  if (is_new(state.alerts)) Fill(*state.alerts.value, proto.mutable_alerts());
  if (is_new(state.agents)) Fill(*state.agents.value, proto.mutable_agents());
  if (is_new(state.goal)) Fill(*state.goal.value, proto.mutable_goal());
  if (is_new(state.monitor)) Fill(*state.monitor.value, proto.mutable_monitor());
  return proto;
}

absl::StatusOr<LiveAnswers::Answer> LiveAnswers::Get(const v1::GetLiveRequest& request) {
  if (tracker_ == nullptr) return absl::UnimplementedError("this server follows no live state");
  const std::string& rig = RigOf(request);
  RIGCAL_RETURN_IF_ERROR(ValidateName("rig name", rig));
  std::shared_ptr<const LiveSnapshot> state = tracker_->Get(rig);
  const std::lock_guard lock(mutex_);
  if (by_rig_.size() >= kMaxRigs && !by_rig_.contains(rig)) by_rig_.clear();
  Cached& cached = by_rig_[rig];
  // Of two that ask at once, one may have the state before: what is newer stays.
  if (cached.state && cached.state->incarnation == state->incarnation &&
      cached.state->revision >= state->revision) {
    state = cached.state;
  } else {
    cached = {.state = state, .by_since = {}};
  }
  const std::optional<uint64_t> since = ReadRevision(*state, request.since_revision());
  const std::string key = since ? absl::StrCat(*since) : "";
  const auto found = cached.by_since.find(key);
  if (found != cached.by_since.end()) return found->second;
  v1::GetLiveResponse response;
  *response.mutable_live() = ToProto(*state, since);
  Answer answer{.revision = response.live().revision(),
                .unchanged = since == state->revision,
                .bytes = std::make_shared<const std::string>(response.SerializeAsString())};
  if (cached.by_since.size() < kMaxAnswers) cached.by_since.emplace(key, answer);
  return answer;
}

std::string LiveAnswers::Revision(const v1::GetLiveRequest& request) const {
  const std::string& rig = RigOf(request);
  if (tracker_ == nullptr || !ValidateName("rig name", rig).ok()) return "";
  return RevisionOf(*tracker_->Get(rig));
}

}  // namespace rigcal::server
