// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"

namespace rigcal::server {

// A clock whose rows fit the others' better at another time.
struct OffsetDoubt {
  int clock = 0;
  double offset_s = 0;  // to be added to its time offset
  double here_px = 0, there_px = 0;
};

// Checks whether a solved rig has matched a clock at a wrong offset: the coarse search knows
// pairs of cameras only, and a periodic motion can match a period off. For each clock the
// markers are triangulated from the cameras of the other clocks (two at least, which must agree),
// and one of its own cameras is fitted to them by resection (direct linear transform, Hartley and
// Zisserman, Multiple View Geometry, section 7.1, reweighted against outliers) at offsets within
// reach. The camera's own solution is not used. Returns the clock that gains most, or none; a rig
// of two clocks cannot be checked.
std::optional<OffsetDoubt> FindBetterOffset(const RigObservations& rig,
                                            const RigSolution& solution);

}  // namespace rigcal::server
