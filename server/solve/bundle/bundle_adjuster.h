// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// Solves the problem in place with Ceres: Levenberg-Marquardt, the instants eliminated first
// (DENSE_SCHUR), one thread, so that equal problems give equal bits. Quaternions come back unit.
//
// INVALID_ARGUMENT: the problem or the options are not valid. FAILED_PRECONDITION: the start cannot
// be evaluated (a used marker behind its camera) or the solver broke down. CANCELLED. On an error
// the problem is left as it was. Not reaching the tolerance within the iterations is no error:
// see `converged`.
absl::StatusOr<BundleSummary> SolveBundle(const BundleOptions& options, BundleProblem* problem);

// u - dt u': where the marker would have been measured at the instant's time.
Eigen::Vector2d CentreAtInstantPx(const BundleProblem& problem,
                                  const BundleObservation& observation, const BundleMarker& marker);

// Residual p - (u - dt u') of one marker in pixels, used or not. False where the camera cannot see
// the marker.
bool MarkerResidualPx(const BundleProblem& problem, const BundleInstant& instant,
                      const BundleObservation& observation, const BundleMarker& marker,
                      Eigen::Vector2d* residual_px);

}  // namespace rigcal::server
