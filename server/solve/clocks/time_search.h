// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <vector>

#include "absl/status/status.h"
#include "server/solve/rig/problem_builder.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {

struct TimeSearchHooks {
  std::function<void(double fraction)> progress;
  const std::atomic<bool>* cancelled = nullptr;
};

// Finds offsets between clocks that are too large to be estimated (the first order in time holds
// for some tens of milliseconds, up to 1 s), and adds them to `clocks`. Along a tree of pairs of
// cameras on different clocks, of those that agree best among some partners of each; of a pair that
// nearly agrees only offsets nearby are tried, and clocks that agree to an eighth of a period stay
// exactly as they are. The reference camera's clock keeps its correction. A clock without an
// accepted offset stays too. CANCELLED.
absl::Status SearchTimeOffsets(const RigObservations& rig, int reference_camera,
                               const TimeSearchHooks& hooks, std::vector<ClockCorrection>* clocks);

}  // namespace rigcal::server
