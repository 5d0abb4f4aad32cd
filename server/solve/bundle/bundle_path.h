// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/line_bundle.h"

namespace rigcal::server {

// The line kernel (line_bundle.h) is for one wand or a point; the general path (bundle_adjuster.h)
// for everything else.
bool NeedsGeneralPath(const BundleProblem& problem);

// SolveLineBundle or SolveBundle, and ComputeReducedInformation or ComputeGeneralInformation, by
// the problem's path. Errors as theirs.
absl::StatusOr<BundleSummary> AdjustBundle(const BundleOptions& options, BundleProblem* problem);
absl::StatusOr<ReducedInformation> ComputeInformation(const BundleOptions& options,
                                                      const BundleProblem& problem);

}  // namespace rigcal::server
