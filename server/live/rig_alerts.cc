// SPDX-License-Identifier: Apache-2.0
#include "server/live/rig_alerts.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "common/statistics/robust_statistics.h"
#include "server/live/alert_rules.h"

namespace rigcal::server {
namespace {

using Time = FollowedRig::Time;

RigFacts FactsOf(const FollowedRig& rig, const StoreHealth& health) {
  RigFacts facts{.capturing = rig.capturing(),
                 .disk_free_bytes = health.room_bytes(),
                 .disk_reserve_bytes = health.reserve_bytes,
                 .disk_known = health.free_bytes > 0 || health.reserve_bytes > 0,
                 .store_problem = health.problem};
  if (rig.estimate()) {
    facts.estimate = rig.estimate()->state;
    facts.estimate_problem = rig.estimate()->problem;
  }
  return facts;
}

// How much later than its own time each camera's rows come, on the common scale, seconds. Without
// those of which it cannot be said.
std::map<std::string, double> ArrivalDelaysS(const FollowedRig& rig, Time now) {
  std::map<std::string, double> delays_s;
  for (const SessionCamera& camera : rig.session()->cameras) {
    const auto activity = rig.activities().find(camera.description.camera);
    if (activity == rig.activities().end()) continue;
    LiveCamera described;
    activity->second.Describe(now, &described);
    const bool behind =
        static_cast<double>(described.backlog_count) > 10 + described.observation_rate_hz;
    // A recording that an agent plays again from its start is no wrong clock.
    const bool replayed = rig.common_timebase() && activity->second.stream_count() > 1;
    const ClockRelation* const clock = rig.FindClock(camera);
    std::optional<int64_t> offset_ns;
    if (rig.common_timebase()) offset_ns = 0;
    if (!offset_ns && clock != nullptr) offset_ns = clock->OffsetNs();
    const auto delay_s = activity->second.ArrivalDelayS();
    if (behind || replayed || !offset_ns || !delay_s) continue;
    delays_s[camera.description.camera] = *delay_s - 1e-9 * static_cast<double>(*offset_ns);
  }
  return delays_s;
}

// The delay that the others are compared with. None: fewer than two are known.
std::optional<double> ReferenceDelayS(const std::map<std::string, double>& delays_s,
                                      bool common_timebase, Time now, int64_t utc_ns) {
  if (delays_s.size() < 2) return std::nullopt;
  std::vector<double> values;
  for (const auto& [camera, delay_s] : delays_s) values.push_back(delay_s);
  if (common_timebase || delays_s.size() > 2) return LowerMedian(std::move(values));
  // Of two, the one nearer to the server's own clock.
  const double server_s = std::chrono::duration<double>(now.time_since_epoch()).count() -
                          1e-9 * static_cast<double>(utc_ns);
  return *std::ranges::min_element(values, {},
                                   [&](double value) { return std::abs(value - server_s); });
}

}  // namespace

std::vector<AlertCondition> ConditionsOf(const FollowedRig& rig, const StoreHealth& health,
                                         Time now, int64_t utc_ns) {
  std::vector<AlertCondition> conditions = RigConditions(FactsOf(rig, health));
  if (rig.monitor()) {
    for (AlertCondition& condition : MonitorConditions(*rig.monitor())) {
      conditions.push_back(std::move(condition));
    }
  }
  if (!rig.capturing()) return conditions;
  const std::map<std::string, double> delays_s = ArrivalDelaysS(rig, now);
  const std::optional<double> reference_s =
      ReferenceDelayS(delays_s, rig.common_timebase(), now, utc_ns);
  for (const SessionCamera& camera : rig.session()->cameras) {
    const std::string& name = camera.description.camera;
    const auto activity = rig.activities().find(name);
    if (activity == rig.activities().end()) continue;
    CameraFacts facts;
    activity->second.Describe(now, &facts);
    facts.agent_id = camera.agent_id;
    const auto connected = rig.connected().find(name);
    facts.agent_connected =
        connected != rig.connected().end() && connected->second.agent_id == camera.agent_id;
    if (const ClockRelation* clock = rig.FindClock(camera)) facts.clock_jump = clock->jump();
    if (const auto delay = delays_s.find(name); delay != delays_s.end() && reference_s) {
      facts.arrival_offset_s = delay->second - *reference_s;
    }
    if (const LiveEstimatedCamera* estimated = rig.FindEstimated(name)) {
      facts.estimated_offset_s = estimated->time_offset_s;
      facts.lens_disagrees = estimated->lens_disagrees;
    }
    for (AlertCondition& condition : CameraConditions(facts)) {
      conditions.push_back(std::move(condition));
    }
  }
  return conditions;
}

}  // namespace rigcal::server
