// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <vector>

#include "absl/status/status.h"
#include "server/solve/clocks/clock_groups.h"
#include "server/solve/clocks/motion_match.h"
#include "server/solve/rig/rig_observations.h"

namespace rigcal::server {

// Two tracks whose motion fits at several offsets of the second, about equally well.
struct AmbiguousMotion {
  int track_a = 0, track_b = 0;
  std::vector<MotionPeak> peaks;  // best first
};

struct StartSearchHooks {
  std::function<void(double fraction)> progress;
  const std::atomic<bool>* cancelled = nullptr;
};

// Joins clocks that are still apart by the motion that their cameras saw (MatchMotion), however far
// they are off: cameras that were started by hand, without any common clock. Each clock is compared
// with others until it has found two partners. Of all these pairs, those that agree with most
// others join the clocks: around each circle of pairs the offsets must add up to nothing. `paths`
// by track. Returns the ambiguous pairs of clocks that nothing else has joined. CANCELLED.
absl::StatusOr<std::vector<AmbiguousMotion>> JoinByMotion(const RigObservations& rig,
                                                          const std::vector<TrackPaths>& paths,
                                                          const StartSearchHooks& hooks,
                                                          ClockGroups* groups);

}  // namespace rigcal::server
