// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

namespace rigcal::server {

// Which cameras of a rig have moved against the others.
struct MovedSet {
  std::vector<size_t> still, moved;  // all cameras, ascending; with a problem all are `still`
  std::string problem;               // why it cannot be told; empty: it can
};

// `difference`: of each camera's pose, six rows, between two times; `covariance`: of that, with the
// freedom of the common frame in it. Without a move the difference is a draw from it. The smallest
// set of moved cameras is searched without which the others are such a draw: as a whole, and each
// one given the rest, at a chance of 1e-7. Among sets of one size the best fitting one is taken,
// unless another one would do as well.
MovedSet FindMovedSet(const Eigen::VectorXd& difference, const Eigen::MatrixXd& covariance);

}  // namespace rigcal::server
