// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {

// Rolling shutters: a marker in image row y of a camera is seen at
//   stamp of the observation + line_delay_s * (y - (height - 1) / 2)
// so that the line delay leaves the clock's offset, which is that of the middle row, as it is.
struct LineDelay {
  double line_delay_s = 0;  // time between two rows; negative where they are read upwards
  double sigma_s = 0;       // one sigma; 0: nothing known
};

struct LineDelayEstimate {
  std::vector<LineDelay> cameras;  // by index of the rig
  double cost_share = 0;           // of the adjustment's robust cost, that the delays take away
};

// What the line delays still are on top of the rows' times, together with everything that the
// solution left free: a bundle adjustment in which the row of each marker is a time of its own
// clock, whose rate is the line delay (the linear model of Oth et al. 2013, "Rolling shutter camera
// calibration", section 3, with the image motion in place of a trajectory). Rates of clocks are
// kept as the solution has them.
//
// Evenly chosen instants of about `max_markers` markers are used; 0: all.
//
// Errors as of AdjustBundle and ComputeInformation.
absl::StatusOr<LineDelayEstimate> EstimateLineDelays(const RigObservations& rig,
                                                     const RigSolveOptions& options,
                                                     const RigSolution& solution,
                                                     size_t max_markers = 0);

// Adds the delays to the times of all markers (`time_delta_ns`), by camera. Solutions of the rig
// are then to be made again.
void AddLineDelays(const std::vector<LineDelay>& cameras, RigObservations* rig);

}  // namespace rigcal::server
