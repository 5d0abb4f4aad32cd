// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// Solves the problem in place with Ceres, whatever its targets (line, rigid, both):
// Levenberg-Marquardt, the instants eliminated first (DENSE_SCHUR), one thread, so that equal
// problems give equal bits. Quaternions come back unit.
//
// INVALID_ARGUMENT: the problem or the options are not valid. FAILED_PRECONDITION: the initial
// values cannot be evaluated (a used marker behind its camera) or the solver broke down. CANCELLED.
// On an error the problem is left as it was. Not reaching the tolerance within the iterations is no
// error: see `converged`.
absl::StatusOr<BundleSummary> SolveBundle(const BundleOptions& options, BundleProblem* problem);

}  // namespace rigcal::server
