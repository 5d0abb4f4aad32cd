// SPDX-License-Identifier: Apache-2.0
#include "server/live/rig_state.h"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "server/live/live_limits.h"
#include "server/live/overlap_counter.h"
#include "server/live/rig_alerts.h"
#include "server/live/session_goal.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::milliseconds kOverlapInterval{500};
constexpr std::chrono::seconds kCountInterval{1};
constexpr size_t kMaxRemoved = 256;

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

}  // namespace

RigState::RigState(std::string rig, std::string incarnation) {
  state_.rig = std::move(rig);
  state_.incarnation = std::move(incarnation);
}

void RigState::Reset() {
  reset_ = true;
  state_.session = {};
  state_.overlap = {};
  state_.estimate = {};
  state_.goal = {};
  alerts_.Clear();
  count_time_.reset();
}

std::shared_ptr<const LiveSnapshot> RigState::Update(const FollowedRig& rig,
                                                     const StoreHealth& health, uint64_t revision,
                                                     Time now, int64_t utc_ns) {
  revision_ = revision;
  now_ = now;
  utc_ns_ = utc_ns;
  changed_ = reset_;
  if (reset_) state_.full_since = revision;
  reset_ = false;

  UpdateCameras(rig);
  UpdateSession(rig);
  UpdateOverlap(rig);
  if (rig.estimate() && state_.estimate.value != rig.estimate()) {
    state_.estimate = {rig.estimate(), revision};
    changed_ = true;
  }
  if (rig.monitor()) Revise(*rig.monitor(), &state_.monitor);
  UpdateAlerts(rig, health);
  UpdateAgents(rig);
  UpdateGoal(rig);

  if (!changed_) return nullptr;
  state_.revision = revision;
  state_.time_utc_ns = utc_ns;
  state_.age_s =
      rig.commit_time() ? std::chrono::duration<double>(now - *rig.commit_time()).count() : 0;
  return std::make_shared<const LiveSnapshot>(state_);
}

template <typename Part>
void RigState::Revise(Part part, Revised<Part>* revised) {
  if (revised->value && *revised->value == part) return;
  revised->value = std::make_shared<const Part>(std::move(part));
  revised->revision = revision_;
  changed_ = true;
}

void RigState::UpdateCameras(const FollowedRig& rig) {
  std::set<std::string> names(rig.order().begin(), rig.order().end());
  for (const auto& [name, camera] : rig.connected()) {
    if (names.size() < OverlapCounter::kMaxCameras) names.insert(name);
  }
  for (const std::string& name : names) {
    LiveCamera camera = rig.DescribeCamera(name, now_);
    if (names.size() > kMaxCamerasWithTrails) camera.trail.clear();
    Revise(std::move(camera), &state_.cameras[name]);
  }
  for (auto camera = state_.cameras.begin(); camera != state_.cameras.end();) {
    if (names.contains(camera->first)) {
      ++camera;
      continue;
    }
    state_.removed_cameras.emplace_back(revision_, camera->first);
    camera = state_.cameras.erase(camera);
    changed_ = true;
  }
  std::erase_if(state_.removed_cameras,
                [&](const auto& removed) { return names.contains(removed.second); });
  if (state_.removed_cameras.size() > kMaxRemoved) {
    state_.removed_cameras.clear();
    state_.full_since = revision_;
    changed_ = true;
  }
}

void RigState::UpdateSession(const FollowedRig& rig) {
  if (!rig.session()) return;
  uint64_t observation_count = 0;
  uint64_t wand_count = 0;
  for (const auto& [name, camera] : state_.cameras) {
    observation_count += camera.value->observation_count;
    wand_count += camera.value->wand_count;
  }
  SessionSummary summary = SummaryOf(*rig.session());
  const bool new_fields =
      !state_.session.value || !SameFields(state_.session.value->session, summary.session);
  const bool new_counts =
      state_.session.value && (state_.session.value->observation_count != observation_count ||
                               state_.session.value->wand_count != wand_count);
  if (!new_fields && (!new_counts || (count_time_ && now_ - *count_time_ < kCountInterval))) return;
  count_time_ = now_;
  summary.observation_count = observation_count;
  summary.wand_count = wand_count;
  summary.late_count = rig.late_count();
  state_.session = {std::make_shared<const SessionSummary>(std::move(summary)), revision_};
  changed_ = true;
}

void RigState::UpdateOverlap(const FollowedRig& rig) {
  if (rig.order().empty()) return;
  if (state_.overlap.value && overlap_time_ && now_ - *overlap_time_ < kOverlapInterval) return;
  overlap_time_ = now_;
  Revise(rig.DescribeOverlap(), &state_.overlap);
}

void RigState::UpdateAlerts(const FollowedRig& rig, const StoreHealth& health) {
  std::vector<AlertCondition> conditions = ConditionsOf(rig, health, now_, utc_ns_);
  for (AlertCondition& condition : conditions) LimitAlertText(&condition.text);
  Revise(alerts_.Update(std::move(conditions), now_, utc_ns_), &state_.alerts);
}

void RigState::UpdateAgents(const FollowedRig& rig) {
  std::vector<LiveAgent> agents;
  for (const AgentRecord& agent : rig.agents()) {
    LiveAgent live{.agent_id = agent.agent_id,
                   .host = agent.host,
                   .connected = agent.connected,
                   .software_version = agent.software_version};
    LimitAgent(&live);
    if (agent.spool) {
      live.spool_rows = agent.spool->row_count;
      live.spool_bytes = agent.spool->bytes;
      live.spool_limit_bytes = agent.spool->limit_bytes;
    }
    agents.push_back(std::move(live));
  }
  Revise(std::move(agents), &state_.agents);
}

void RigState::UpdateGoal(const FollowedRig& rig) {
  if (!rig.session() || !rig.session()->goal) return;
  const Session& session = *rig.session();
  LiveGoal goal;
  if (rig.capturing()) {
    const double elapsed_s = 1e-9 * static_cast<double>(utc_ns_ - session.start_utc_ns);
    goal = JudgeGoal(*session.goal, session, rig.estimate().get(), elapsed_s, utc_ns_);
  } else {
    goal.until_mm = session.goal->until_mm;
    if (rig.estimate() && rig.estimate()->volume) goal.now_mm = rig.estimate()->volume->p95_mm;
    goal.reached = !session.stop_reason.empty();
    if (!goal.reached) {
      goal.why_not = session.state == SessionState::kCreated ? "it has not been started"
                                                             : "it was stopped before";
    }
  }
  Revise(std::move(goal), &state_.goal);
}

}  // namespace rigcal::server
