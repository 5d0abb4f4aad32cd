// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// What the target's pose leaves of times that are wrong: a row that is seen too late moves the pose
// along its image motion, so that its own residuals show a part of the shift only, and those of the
// other cameras at that instant show another. With r = (I - H) V s of one instant (H: the hat
// matrix of its pose, V: whitened image motion by row, s: shifts of the rows), the shift that fits
// row a best is sum_b f_ab s_b with
//   f_ab = (delta_ab |v_a|^2 - v_a^T H_ab v_b) / |v_a|^2.
// By camera of the row and camera that is shifted: the mean of f_ab^2, over some instants of a
// solved problem of a line target.
Eigen::MatrixXd ShownShares(const BundleProblem& problem);

// Variances x >= 0 of the cameras' own shifts for which shares * x is nearest to `shown`. Where
// cameras cannot be told apart they share alike.
std::vector<double> OwnVariances(const Eigen::MatrixXd& shares, const std::vector<double>& shown);

}  // namespace rigcal::server
