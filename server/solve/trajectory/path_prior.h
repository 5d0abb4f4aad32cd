// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "server/solve/trajectory/banded_matrix.h"
#include "server/solve/trajectory/trajectory_problem.h"

namespace rigcal::server {

// What is known of a path before any row is looked at: third differences of neighbouring knots of
// the sigmas of the problem, and directions of about unit length, which mean nothing but must not
// run away.

// The negative logarithm of its density, over all spans; without a constant.
double PathPriorCost(const TrajectoryProblem& problem);

// Adds its information about the knots of a span (Gauss-Newton), and the gradient of its cost.
// `matrix` and `gradient` have a row for each number of the knots, the matrix a bandwidth of four
// knots less one number.
void AddPathPrior(const TrajectoryProblem& problem, size_t span, BandedMatrix* matrix,
                  Eigen::VectorXd* gradient);

// What the paths still are free in, where the data have their say as well.
struct PathFreedom {
  double values = 0;  // numbers of the data that the paths take up
  // Of the third differences: how many the data decide, and their sum of squares.
  double origin_by_data = 0, origin_square = 0;
  double direction_by_data = 0, direction_square = 0;
};
// Adds that of a span; `covariance` of its knots by data and prior, the entries within the band.
void AddPathFreedom(const TrajectoryProblem& problem, size_t span, const BandedMatrix& covariance,
                    PathFreedom* freedom);

}  // namespace rigcal::server
