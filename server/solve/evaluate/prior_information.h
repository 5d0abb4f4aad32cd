// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/line_bundle.h"

namespace rigcal::server {

// The part of a problem's information about `parameters` that its priors bring: those of
// intrinsics, clocks, line delays, the spans of wands and the points of a rigid target. In the
// order of the parameters. (The prior on a distance of two cameras is not among them.)
Eigen::MatrixXd PriorInformation(const BundleProblem& problem,
                                 const std::vector<ReducedParameter>& parameters);

}  // namespace rigcal::server
