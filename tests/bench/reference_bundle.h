// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/line_bundle.h"

namespace rigcal::testing {

// A plain solver of BundleProblem: automatic differentiation per marker and Ceres's EIGEN_SPARSE
// with a Schur complement, one thread. It shares the residual with server/solve (which
// marker_cost_test compares with OpenCV's formulas) but no derivative, no elimination and no solver:
// the oracle of the tests and the reference of the benchmarks. Intrinsics that are not estimated
// are constants of the cost, not parameters.
//
// `minimizer_s`, if given: seconds without the preparation.
absl::StatusOr<server::BundleSummary> SolveReferenceBundle(const server::BundleOptions& options,
                                                           server::BundleProblem* problem,
                                                           double* minimizer_s = nullptr);

// The covariance of `parameters`, in their order and units of step, at the
// problem's estimates: ceres::Covariance over all free parameters, instants included.
absl::StatusOr<Eigen::MatrixXd> ReferenceCovariance(
    const server::BundleOptions& options, const server::BundleProblem& problem,
    const std::vector<server::ReducedParameter>& parameters);

}  // namespace rigcal::testing
