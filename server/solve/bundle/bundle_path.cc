// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/bundle_path.h"

#include "server/solve/bundle/bundle_adjuster.h"
#include "server/solve/bundle/bundle_information.h"

namespace rigcal::server {

SolverPath PathOf(const BundleProblem& problem) {
  return problem.HasRigidTarget() ? SolverPath::kGeneral : SolverPath::kLineKernel;
}

absl::StatusOr<BundleSummary> AdjustBundle(const BundleOptions& options, BundleProblem* problem) {
  return PathOf(*problem) == SolverPath::kGeneral ? SolveBundle(options, problem)
                                                  : SolveLineBundle(options, problem);
}

absl::StatusOr<ReducedInformation> ComputeInformation(const BundleOptions& options,
                                                      const BundleProblem& problem) {
  return PathOf(problem) == SolverPath::kGeneral ? ComputeGeneralInformation(options, problem)
                                                 : ComputeReducedInformation(options, problem);
}

}  // namespace rigcal::server
