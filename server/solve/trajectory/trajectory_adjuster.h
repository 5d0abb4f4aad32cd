// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/trajectory/trajectory_problem.h"

namespace rigcal::server {

struct TrajectorySummary {
  double initial_cost = 0, final_cost = 0;  // by the sigmas of the path at the end
  int iterations = 0;
  bool converged = false;
  // One sigma of the whitened residuals by their median, their freedom taken into account: 1 where
  // the stated covariances and the path are right.
  double residual_sigma = 1;
  double path_freedom = 0;  // of the paths, in numbers
};

// Solves the problem in place: paths, cameras, clocks and target. The sigmas of the third
// differences are estimated with them by restricted maximum likelihood, from the third differences
// and the residuals that the data leave (Wood and Fasiolo 2017, generalized Fellner-Schall); they
// begin at the given ones. Sums in a fixed order: equal problems give equal bits.
//
// INVALID_ARGUMENT: the problem or the options are not valid. FAILED_PRECONDITION: no marker is
// used, a used marker is not visible at the initial values, or the data do not determine the
// parameters. CANCELLED.
absl::StatusOr<TrajectorySummary> AdjustTrajectory(const BundleOptions& options,
                                                   TrajectoryProblem* problem);

// Finds outliers anew among all markers of all rows in spans: those further from the path than 8
// sigmas of their camera's residuals (outliers.h) and of the path itself, which is known better
// where several cameras see it. Returns how many changed.
int ClassifyOutliersOfPath(const BundleOptions& options, TrajectoryProblem* problem);

}  // namespace rigcal::server
