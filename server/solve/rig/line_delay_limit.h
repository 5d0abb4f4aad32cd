// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/rig/rig_observations.h"

namespace rigcal::server {

// A rolling shutter reads one frame after the other, so that the rows of an image are read within
// the frame's period: the longest line delay of each camera, seconds a row. Infinite where no
// period is known.
std::vector<double> LongestLineDelays(const RigObservations& rig);

// A line delay that is held at the longest, of either sign, but for what rounding makes of it.
bool IsAtLimit(double line_delay_s, double longest_s);

// The problem's line delays on top of `delays_s` (by camera): those that are free and beyond the
// longest are held at it. Returns how many.
int HoldLongLineDelays(const std::vector<double>& longest_s, const std::vector<double>& delays_s,
                       BundleProblem* problem);

}  // namespace rigcal::server
