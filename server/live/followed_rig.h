// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/session/session.h"
#include "server/live/arrivals.h"
#include "server/live/camera_activity.h"
#include "server/live/clock_relation.h"
#include "server/live/earlier_waves.h"
#include "server/live/live_state.h"
#include "server/live/overlap_counter.h"
#include "server/session/agent_directory.h"

namespace rigcal::server {

// What is known of one rig now: its session, what each camera of it does, how their clocks relate,
// what they have seen at once, the running estimate, and the agents. Of a session only the first
// OverlapCounter::kMaxCameras cameras are followed. Memory is bounded. For one thread at a time.
class FollowedRig {
 public:
  using Time = std::chrono::steady_clock::time_point;
  struct ConnectedCamera {
    std::string agent_id;
    CameraDescription description;
  };

  // --- Inputs ---

  // Follows this session from now on. True: it is another one or has other cameras, so everything
  // that was counted is forgotten. False: only its fields may be new.
  bool Follow(const Session& session, Time now);
  // Follows no session.
  void ForgetSession();
  // What was stored of the session before it was followed.
  void SetStored(const std::vector<SessionCameraCounts>& counts);
  // What the sessions that this one continues have seen.
  void AddEarlier(const EarlierCounts& earlier);
  // All agents of the rig.
  void SetAgents(std::vector<AgentRecord> agents);
  // The running estimate of the session, within the limits of live_limits.h.
  void SetEstimate(std::shared_ptr<const LiveEstimate> estimate) {
    estimate_ = std::move(estimate);
  }
  void SetMonitor(std::shared_ptr<const LiveMonitor> monitor) { monitor_ = std::move(monitor); }
  // Rows, clock samples and reports of one stream of the session. The overlap is counted apart.
  void AddArrivals(const StreamKey& stream, const Arrivals& arrived, Time now, int64_t utc_ns);
  // Counts what cameras have seen at once; arrivals of other sessions count for nothing. Call it
  // after AddArrivals of all streams, which may change the clock offsets.
  void CountOverlap(const std::vector<std::pair<StreamKey, Arrivals>>& arrived);
  // Forgets what is too old. Call it once before each state that is made.
  void Advance(Time now);

  // --- Results ---

  const std::optional<Session>& session() const { return session_; }
  bool capturing() const { return session_ && session_->state == SessionState::kCapturing; }
  // Names of the session's cameras, in its order.
  const std::vector<std::string>& order() const { return order_; }
  // Of the session's cameras, by name.
  const std::map<std::string, CameraActivity>& activities() const { return activities_; }
  // Null: nothing has come from this clock.
  const ClockRelation* FindClock(const SessionCamera& camera) const;
  // All clocks of the session follow one.
  bool common_timebase() const { return common_timebase_; }
  const std::shared_ptr<const LiveEstimate>& estimate() const { return estimate_; }
  // Null: the rig has not been monitored.
  const std::shared_ptr<const LiveMonitor>& monitor() const { return monitor_; }
  // Null: the estimate has no such camera, or there is none.
  const LiveEstimatedCamera* FindEstimated(const std::string& camera) const;
  const std::vector<AgentRecord>& agents() const { return agents_; }
  // Cameras of connected agents, by name.
  const std::map<std::string, ConnectedCamera>& connected() const { return connected_; }
  // Rows that came after the end of the session, as stored when it was first followed.
  uint64_t late_count() const { return late_count_; }
  // When the newest row became durable.
  const std::optional<Time>& commit_time() const { return commit_time_; }
  // Rig time minus camera time, nanoseconds: from a common time base, else from clock samples, else
  // from the arrival of rows; where that is off by more than 20 ms, from a wand's light code that
  // another camera has read, too. With the camera's latency and its estimated offset. None: not
  // known.
  std::optional<int64_t> OffsetNs(const SessionCamera& camera, uint32_t clock_epoch) const;

  // A camera of the session or of a connected agent, as it is shown.
  LiveCamera DescribeCamera(const std::string& name, Time now) const;
  // How many instants each two cameras of the session have in common.
  LiveOverlap DescribeOverlap() const;

 private:
  // Rig time, nanoseconds: rows beyond it are of a clock that is wrong. None: no clock is known.
  std::optional<int64_t> NewestComparedNs() const;
  void CountOverlapOf(size_t place, const std::vector<ThinnedRow>& rows, int64_t limit_ns);
  // Without latency, estimate and light codes.
  std::optional<int64_t> CoarseOffsetNs(const SessionCamera& camera, uint32_t clock_epoch) const;
  // By the light code, against the first camera that has read the same wand; none for that one.
  std::optional<int64_t> LightOffsetNs(const SessionCamera& camera, uint32_t clock_epoch) const;

  std::optional<Session> session_;
  bool common_timebase_ = false;
  std::vector<std::string> order_;
  std::map<std::string, CameraActivity> activities_;
  std::unique_ptr<OverlapCounter> overlap_;      // in order_; null: no session
  std::map<std::string, ClockRelation> clocks_;  // by clock_id
  // By camera, with the clock epoch: the last light code read.
  std::map<std::string, std::pair<uint32_t, ClockSample>> wand_times_;
  // By camera, with the clock epoch: of the row that took least to arrive.
  std::map<std::string, std::pair<uint32_t, int64_t>> arrival_offsets_ns_;
  std::shared_ptr<const LiveEstimate> estimate_;
  std::shared_ptr<const LiveMonitor> monitor_;
  uint64_t late_count_ = 0;
  std::optional<Time> commit_time_;
  std::vector<AgentRecord> agents_;
  std::map<std::string, ConnectedCamera> connected_;
};

}  // namespace rigcal::server
