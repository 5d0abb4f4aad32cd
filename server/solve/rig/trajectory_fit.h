// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"
#include "server/solve/trajectory/trajectory_adjuster.h"
#include "server/solve/trajectory/trajectory_problem.h"

namespace rigcal::server {

// The path of the target through a recording, solved together with the rig.
struct TrajectoryFit {
  TrajectoryProblem problem;
  TrajectorySummary summary;
  std::vector<MarkerSource> sources;  // by marker of the rows
  std::vector<int64_t> row_time_ns;   // rig time by the clocks it began with, by row

  // Of the span with most knots.
  double KnotStepS() const;
  // Root of the spectral density of the jerk, m/s^2.5: how unsteady the origin moves.
  double JerkDensity() const;
};

// Solves a rig again whose cameras and clocks are about right, with a path through time instead of
// a pose for each instant: every row counts at its own time, also those that no other camera shares
// (trajectory_problem.h). Begins at the solution and its instants, ends with its cameras, clocks,
// line delays and spacing at the new optimum, its instants placed anew by these, and `trajectory`
// set, from which ComputeUncertainty takes the covariance. Of the rows those that `keep_instant`
// keeps; the options that thin out and end early are not looked at.
//
// `like`: another path of the same motion, whose unsteadiness this one begins with.
//
// The path is cut where no instant is placed for a second. Rows beyond its ends have no part.
//
// FAILED_PRECONDITION: a rigid target, too few instants in a row, the rows determine no path, or
// there are too many of them for memory.
// CANCELLED.
absl::StatusOr<RigSolution> SolveOnTrajectory(const RigObservations& rig,
                                              const RigSolveOptions& options,
                                              const RigSolution& solution,
                                              const TrajectoryFit* like = nullptr);

}  // namespace rigcal::server
