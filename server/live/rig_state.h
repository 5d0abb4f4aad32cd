// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "server/live/alert_book.h"
#include "server/live/followed_rig.h"
#include "server/live/live_state.h"
#include "server/store/store.h"

namespace rigcal::server {

// The published state of one rig. Each part carries the revision at which it last changed, so that
// a client with an older state needs the difference only. The overlap is made at most twice a
// second, the counts of the session once a second. For one thread at a time.
class RigState {
 public:
  using Time = FollowedRig::Time;

  RigState(std::string rig, std::string incarnation);

  // The rig follows another session. A client that knows an older revision gets the whole state
  // next time: a difference cannot say that a part is gone.
  void Reset();
  // Makes the state of the rig now; call FollowedRig::Advance first. `revision` is above all
  // earlier ones. Null: nothing has changed, and the revision is free.
  std::shared_ptr<const LiveSnapshot> Update(const FollowedRig& rig, const StoreHealth& health,
                                             uint64_t revision, Time now, int64_t utc_ns);
  const LiveSnapshot& snapshot() const { return state_; }

 private:
  template <typename Part>
  void Revise(Part part, Revised<Part>* revised);
  void UpdateCameras(const FollowedRig& rig);
  void UpdateSession(const FollowedRig& rig);
  void UpdateOverlap(const FollowedRig& rig);
  void UpdateAlerts(const FollowedRig& rig, const StoreHealth& health);
  void UpdateAgents(const FollowedRig& rig);
  void UpdateGoal(const FollowedRig& rig);

  LiveSnapshot state_;
  AlertBook alerts_;
  bool reset_ = false;  // since the last state
  std::optional<Time> count_time_;
  std::optional<Time> overlap_time_;

  // Of the update that runs.
  uint64_t revision_ = 0;
  Time now_;
  int64_t utc_ns_ = 0;
  bool changed_ = false;
};

}  // namespace rigcal::server
