// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/line_bundle.h"

namespace rigcal::server {

// ComputeReducedInformation (line_bundle.h) for every kind of target: the same matrix, the points
// of a rigid target that are estimated behind the other columns. The Schur complement of Triggs et
// al. 2000, "Bundle adjustment - a modern synthesis", section 6.1, instant by instant.
//
// INVALID_ARGUMENT: the problem or the options are not valid. FAILED_PRECONDITION: no marker is
// used; a used marker is not visible; an instant whose pose its markers do not determine.
absl::StatusOr<ReducedInformation> ComputeGeneralInformation(const BundleOptions& options,
                                                             const BundleProblem& problem);

}  // namespace rigcal::server
