// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "server/solve/evaluate/held_out.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// The options of a solve that is evaluated on what `keep` leaves out: thinned to what such a
// comparison needs, and rough.
RigSolveOptions OptionsOfFold(const RigObservations& rig, RigSolveOptions options,
                              std::function<bool(int64_t rig_time_ns)> keep);

// Solves on what the options keep; the rows of the solution are put away.
absl::StatusOr<RigSolution> SolveFold(const RigObservations& rig, const RigInitialization& initial,
                                      const RigSolveOptions& options);

// Reports the progress of all stages of a solve as that of one. None if there is none to report to.
std::function<void(CalibrationStage, double)> ProgressAs(CalibrationStage stage,
                                                         const RigSolveOptions& options);

// As EvaluateSolution, in about `max_observations` (0: all). FAILED_PRECONDITION where these are
// fewer than 20 instants.
absl::StatusOr<EvaluatedErrors> EvaluateHeldOut(
    const RigObservations& rig, const RigSolution& solution, RigSolveOptions options,
    size_t max_observations, const std::function<bool(int64_t rig_time_ns)>& select);

// One of several ways to solve a rig.
struct SolveVariant {
  const RigObservations* rig = nullptr;
  const RigInitialization* initial = nullptr;
  RigSolveOptions options;
};

// A twelfth of the span from `first_ns` to `last_ns`, at least 2 s, in turns held out and not.
// Errors of neighbouring times, and of neighbouring places in the images, have much in common: what
// fits two seconds between others need not fit where nothing was seen. Blocks as long as can be had
// with enough of them to know their scatter.
TimeBlocks LongBlocks(int64_t first_ns, int64_t last_ns);
// Of these, those that the span touches.
int CountBlocks(const TimeBlocks& blocks, int64_t last_ns);

// Errors of each variant in each of `count` blocks (of period 2): solved without the even ones and
// evaluated on them, and the other way round. An empty list for a variant that could not be solved.
// CANCELLED.
absl::StatusOr<std::vector<std::vector<EvaluatedErrors>>> EvaluateVariants(
    const std::vector<SolveVariant>& variants, const TimeBlocks& blocks, int count);

// Held-out errors of two variants in the same blocks, which are the clusters of what they scatter
// by: neighbouring instants are not independent, blocks nearly are.
struct HeldOutGain {
  double before_px = 0, after_px = 0;  // means over the blocks that have both
  double sigma_px = 0;                 // standard error of their difference
  // Of the signed ranks of the differences by their standard deviation if there is none (Wilcoxon,
  // Individual Comparisons by Ranking Methods, 1945): blocks differ in size of error by far more
  // than normal numbers do. Positive: smaller after.
  double rank_sigmas = 0;
  int blocks = 0;

  // Smaller by `share` of it, and by `sigmas` standard errors or of the ranks, in at least four
  // blocks.
  bool IsClear(double share, double sigmas) const;
};
HeldOutGain CompareByBlock(const std::vector<double>& before_px,
                           const std::vector<double>& after_px);
// By ChoiceScorePx.
HeldOutGain CompareVariants(const std::vector<EvaluatedErrors>& before,
                            const std::vector<EvaluatedErrors>& after);

}  // namespace rigcal::server
