// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <vector>

#include "absl/status/status.h"
#include "server/solve/rig/problem_builder.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {

struct TimeSearchOptions {
  double reach_s = 1.0;        // largest offset between two clocks
  double step_s = 0.01;        // first steps; the solve needs about 10 ms
  double fine_step_s = 0.001;  // around the best of them
  int max_samples = 250;       // wand views of one camera that are compared with another's
  // An offset is accepted when its score is below this share of the score of wrong offsets.
  double convincing_share = 0.3;
  double convincing_px = 4;  // and it must score better than this
  double aligned_px = 1.2;   // a nearby offset with this score is accepted at once
  std::function<void(double fraction)> progress;
  const std::atomic<bool>* cancelled = nullptr;
};

// Inconsistency of two cameras when the second one's rows are `offset_s`
// later than their rig times say: the median epipolar distance, in pixels, of the fundamental
// matrix that fits best (eight-point algorithm, reweighted against outliers) between the first
// camera's views and the second one's interpolated at the same times. Infinite where too little is
// seen by both.
double EpipolarScorePx(const RigObservations& rig,
                       const std::vector<std::vector<int64_t>>& times_ns, int track_a, int track_b,
                       double offset_s, int max_samples);

// Finds offsets between clocks that are too large to be estimated (the first order in time holds
// for some tens of milliseconds), and adds them to `clocks`. Along a tree of pairs of cameras on
// different clocks, of those that agree best among some partners of each; of a pair that nearly
// agrees only offsets nearby are tried, and clocks that agree to an eighth of a period stay
// exactly as they are. The reference camera's clock keeps its correction. A clock without an
// accepted offset stays too. CANCELLED.
absl::Status SearchTimeOffsets(const RigObservations& rig, int reference_camera,
                               const TimeSearchOptions& options,
                               std::vector<ClockCorrection>* clocks);

}  // namespace rigcal::server
