// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/bundle_path.h"

#include "server/solve/bundle/bundle_adjuster.h"
#include "server/solve/bundle/bundle_information.h"

namespace rigcal::server {

bool NeedsGeneralPath(const BundleProblem& problem) {
  return problem.HasRigidTarget() || problem.HasSeveralWands();
}

absl::StatusOr<BundleSummary> AdjustBundle(const BundleOptions& options, BundleProblem* problem) {
  return NeedsGeneralPath(*problem) ? SolveBundle(options, problem)
                                    : SolveLineBundle(options, problem);
}

absl::StatusOr<ReducedInformation> ComputeInformation(const BundleOptions& options,
                                                      const BundleProblem& problem) {
  return NeedsGeneralPath(problem) ? ComputeGeneralInformation(options, problem)
                                   : ComputeReducedInformation(options, problem);
}

}  // namespace rigcal::server
