// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <vector>

#include "absl/status/status.h"
#include "server/solve/clocks/start_search.h"
#include "server/solve/rig/problem_builder.h"
#include "server/solve/rig/rig_observations.h"

namespace rigcal::server {

struct TimeSearchHooks {
  std::function<void(double fraction)> progress;
  const std::atomic<bool>* cancelled = nullptr;
  // Looks for offsets of up to 1 s only: quickly over, and of a recording that has just begun a
  // longer search can say nothing yet.
  bool only_nearby = false;
};

// A clock that was found by the motion that its cameras saw.
struct ClockByMotion {
  int track = 0;
  double offset_s = 0;  // against the median clock of its session
};

struct TimeSearchOutcome {
  std::vector<ClockByMotion> by_motion;    // by track; of those that were far off
  std::vector<AmbiguousMotion> ambiguous;  // pairs that would have to be known, and are not
  // The motion repeats itself after so long (FindMotionPeriod), and there are several clocks: 0 if
  // it does not.
  double period_s = 0;
};

// Finds offsets between clocks that are too large to be estimated (the first order in time holds
// for some tens of milliseconds), and adds them to `clocks`. Along a tree of pairs of cameras on
// different clocks, of those that agree best among some partners of each; of a pair that nearly
// agrees only offsets nearby are tried, and clocks that agree to an eighth of a period stay exactly
// as they are. Clocks that are farther apart are found by their motion, wherever the recordings
// overlap (start_search.h); where that finds nothing, offsets of up to 1 s are tried one by one.
// Clocks that a wand's light code relates are nearby, and are not searched elsewhere.
// The reference camera's clock keeps its correction. A clock without an accepted offset stays too.
// `outcome`, if not null: what was found and what could not be decided. CANCELLED.
absl::Status SearchTimeOffsets(const RigObservations& rig, int reference_camera,
                               const TimeSearchHooks& hooks, std::vector<ClockCorrection>* clocks,
                               TimeSearchOutcome* outcome = nullptr);

}  // namespace rigcal::server
