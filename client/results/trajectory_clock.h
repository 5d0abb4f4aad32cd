// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "client/results/trajectory.h"
#include "client/results/trajectory_match.h"

namespace rigcal::client {

// The same rows at `about_s` + `factor` times their distance from it in time.
Trajectories WithClock(const Trajectories& all, double factor, double about_s);

// The time between two rows of a point, a typical one; 0 of single rows.
double TypicalSpacingS(const Trajectories& all);

// The factor for the times of the ground truth with which the two fit better than they do at this
// offset: its clock runs at another rate. The offset is searched piece by piece; none where the
// pieces do not say it together, or there are too few rows.
std::optional<double> FindClockRate(const Trajectories& estimate, const Trajectories& ground_truth,
                                    double offset_s, double longest_gap_s, bool fit_scale);

// 1e-3 where times of the ground truth are perhaps milliseconds, 1e3 where those of the estimate
// are; 1e-6 and 1e-9 likewise: the factors with which rows of both come at similar rates, where
// they do not as they are.
std::vector<double> PossibleTimeUnits(const Trajectories& estimate,
                                      const Trajectories& ground_truth);

}  // namespace rigcal::client
