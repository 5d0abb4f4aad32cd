// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/status.h"
#include "server/solve/evaluate/evaluated_solve.h"
#include "server/solve/evaluate/pose_covariance.h"
#include "server/solve/rig/rig_observations.h"

namespace rigcal::server {

// Adds what an earlier calibration knows of the poses to a solve without it: one step of a Kalman
// filter (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation,
// section 5.2) from the solve's optimum, exact as far as the problem is linear over the difference
// of the two, which is millimetres. Intrinsics, clocks and the target follow by their covariance
// with the poses; the target is placed anew. Both covariances are those of the shape: the wand is
// the same, so that the scale gains nothing.
//
// Lenses that both have refined (RigPoses::lenses) are part of it with their correlations. The
// solve has a weak prior of its own around the earlier lenses (intrinsics_prior.h), which is then
// counted twice; beside what a wave says of a lens it is little.
//
// `prior`: in the frame of the solve, its reference camera held fixed. Of the joint covariance the
// rows of the cameras that both have are used. What is held out of the solve, and the errors on it,
// stay those of the solve without the prior.
// INTERNAL: the covariances are singular. Errors of PlaceRig.
absl::Status AddPosePrior(const RigObservations& rig, const RigPoses& prior,
                          EvaluatedSolution* evaluated);

}  // namespace rigcal::server
