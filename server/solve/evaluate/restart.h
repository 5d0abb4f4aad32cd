// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {

struct RestartOptions {
  // A marker agrees with a solution that puts it within this, in pixels or in its own sigmas.
  double agree_px = 4;
  double agree_sigmas = 8;
  // A camera is doubted when less than this share of its markers agrees. With a majority
  // of outliers nothing can be solved.
  double doubt_share = 0.6;
  int min_markers = 30;  // of a camera, to compute its share
  int max_restarts = 3;
  double truncation_px = 20;  // of the errors that solutions are compared by
  double must_gain = 0.2;     // share of that error that must go
};

// Agreement of the markers of a rig with their projections, used or not.
struct Agreement {
  std::vector<double> shares;  // by camera, of its markers; 1 where there are too few
  double error_px = 0;         // mean over all markers, each at most the truncation
  std::vector<int> doubted;    // cameras, worst first
};
Agreement MeasureAgreement(const BundleProblem& problem, const RestartOptions& options);

// Leads a solve out of a wrong minimum. Where every camera agrees with the solution, this measures
// that and no more. Else, up to `max_restarts` times while cameras are doubted, it solves again
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
                                                      const RestartOptions& options,
                                                      RigSolution* solution);

}  // namespace rigcal::server
