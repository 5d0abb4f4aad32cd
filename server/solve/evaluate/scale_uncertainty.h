// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/evaluate/uncertainty.h"

namespace rigcal::server {

// Separates the covariance of a solution by what is known of the unit of length: fills
// `scale_sigma_rel`, and `shape_covariance` with the length that gives the scale held fixed.
//
// Where the scale is the distance of two cameras (BundleProblem::distance), the solver's hold on it
// is not what is known of it: that is `distance_sigma_m`, 0 where the distance is only the unit;
// the covariance is changed to it. Else the scale is that of the target's own lengths, and of
// several targets that of the one that is known best; those that are estimated agree.
void DescribeScale(const BundleProblem& problem, double distance_sigma_m,
                   RigUncertainty* uncertainty);

}  // namespace rigcal::server
