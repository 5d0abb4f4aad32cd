// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "server/solve/evaluate/error_figures.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// Blocks of time, some of which are held out of a solve and used to evaluate it.
struct TimeBlocks {
  int64_t origin_ns = 0;  // rig time at which block 0 begins
  int64_t block_ns = 2'000'000'000;
  int64_t guard_ns = 200'000'000;  // around a block that is held out, no part of either side
  int period = 4;

  // The number of the block; negative before the origin.
  int64_t Block(int64_t rig_time_ns) const;
  // In a block whose number leaves `remainder` when divided by the period.
  bool IsHeldOut(int64_t rig_time_ns, int remainder) const;
  // Neither in such a block nor within the guard of one.
  bool IsKept(int64_t rig_time_ns, int remainder) const;
};

// Errors of a solution on instants, by camera of the rig; inlier markers only.
struct EvaluatedErrors {
  // Reprojection of the rigid target placed by all cameras that saw it.
  std::vector<std::vector<double>> reprojection_px;
  // Each marker triangulated from the other cameras alone (two at least) and projected into the one
  // left out.
  std::vector<std::vector<double>> leave_one_out_px;
  LengthErrors lengths;  // from at least three cameras, without the wand constraint
  int instant_count = 0;
};

// Evaluates a solution: places the target in those instants for which `select` holds (in about
// `options.max_observations` of them, if not 0), by the cameras, clocks and target of the solution
// alone, and measures errors. Outliers are classified
// anew (outliers.h).
EvaluatedErrors EvaluateSolution(const RigObservations& rig, const RigSolution& solution,
                                 const RigSolveOptions& options,
                                 const std::function<bool(int64_t rig_time_ns)>& select);

// The same, by part: `part_of` gives the part that an instant belongs to, 0 to `parts` - 1;
// anything else: none. One part's errors are those that EvaluateSolution has of it, but for the
// outliers, which are classified over all parts together. Lengths are measured of one part only.
std::vector<EvaluatedErrors> EvaluateParts(const RigObservations& rig, const RigSolution& solution,
                                           const RigSolveOptions& options, int parts,
                                           const std::function<int(int64_t rig_time_ns)>& part_of);

// One figure to choose by: the mean over the cameras of the leave-one-camera-out error, or where
// there is too little of it of the reprojection error. Infinite where there is nothing to evaluate.
double ChoiceScorePx(const EvaluatedErrors& errors);

}  // namespace rigcal::server
