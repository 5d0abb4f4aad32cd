// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// Agreement of the markers of a rig with their projections, used or not: a marker agrees with a
// solution that puts it within 4 px or 8 of its own sigmas, and a camera is doubted when less than
// 60 % of its markers agree. With a majority of outliers nothing can be solved.
struct Agreement {
  std::vector<double> shares;  // by camera, of its markers; 1 where there are too few
  double error_px = 0;         // mean over all markers, each at most 20 px
  std::vector<int> doubted;    // cameras, worst first
};
Agreement MeasureAgreement(const BundleProblem& problem);

// Leads a solve out of a wrong minimum. Where every camera agrees with the solution, this measures
// that and no more. Else, up to three times while cameras are doubted, it solves again
//   from the doubted cameras' poses found anew (EPnP in RANSAC) from markers that the cameras not
//   doubted triangulate, two at least; this costs little and comes first, or
//   from a new initialization, with other random choices, where the pair of the former spanning
//   tree that agrees worst on the rigid target is avoided (InitializationOptions::avoided_pairs),
// and keeps what makes the error clearly smaller. `clocks` are those the solve began with. Gives
// the finding `restarted` where another solution was kept; a solution that was right and does not
// fit (wrong intrinsics, a camera that moved) stays and gives none.
//
// CANCELLED; errors of solves that lead nowhere are not passed on.
absl::StatusOr<std::optional<Finding>> RestartIfWrong(const RigObservations& rig,
                                                      const std::vector<ClockCorrection>& clocks,
                                                      const RigSolveOptions& solve,
                                                      RigSolution* solution);

}  // namespace rigcal::server
