// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/trajectory/trajectory_spline.h"

namespace rigcal::server {

// The bundle adjustment of a target that moves steadily: instead of a pose for each instant there
// is a path through time, and every row of every camera is compared with it at the row's own time:
//
//   minimise  1/2 sum over used markers of rho( |r|^2 )
//             + 1/2 sum over knots of |third difference|^2 / sigma^2  +  1/2 sum of priors
//   r = L * (pi(K_c, cam_from_rig_c * (origin(t) + s_m * direction(t))) - u)
//   t = time_s + time_offset_s + time_rate * clock_time_s + line_delay_s * (u_y - middle_row)
//
// with u the centre as measured. Rows that no other camera has a counterpart of take part like all
// others. The third differences are those of a path whose jerk is white noise, on a grid; how
// strong, the data say (trajectory_adjuster.h). Targets are lines and points.
struct TrajectoryProblem {
  // Cameras, clocks, target, their priors and what of them is fixed, as in any bundle problem. Each
  // instant is one row, with one observation; its pose and the markers' velocities are not read.
  BundleProblem rows;
  std::vector<double> time_s;    // by marker: when it was seen, by the rows' clocks as they stand
  std::vector<int> span_of_row;  // by instant; -1: it takes no part
  std::vector<TrajectorySpan> spans;
  // One sigma of the third differences of the knots, in units of a marker's whitened residual:
  // metres, and the same of the direction.
  double origin_sigma = 1e-3;
  double direction_sigma = 3e-3;

  double TimeOf(const BundleObservation& observation, const BundleMarker& marker) const {
    return time_s[rows.IndexOf(marker)] + rows.TimeShiftS(observation, marker);
  }
  // L (p - u) of a marker of a row; none where its camera cannot see it, or the row has no span.
  std::optional<Eigen::Vector2d> WhitenedResidual(size_t row, const BundleObservation& observation,
                                                  const BundleMarker& marker) const;

  // INVALID_ARGUMENT: as of BundleProblem; lists that do not fit; a span of fewer than four knots;
  // a rigid target; sigmas that are not positive.
  absl::Status Validate() const;
};

// Calls function(row, observation, marker) for all that is part of the cost.
template <typename Function>
void ForEachUsedMarkerOfRows(const TrajectoryProblem& problem, const Function& function) {
  for (size_t row = 0; row < problem.rows.instants.size(); ++row) {
    if (problem.span_of_row[row] < 0) continue;
    ForEachUsedMarker(problem.rows, problem.rows.instants[row],
                      [&](const BundleObservation& observation, const BundleMarker& marker) {
                        function(row, observation, marker);
                      });
  }
}

}  // namespace rigcal::server
