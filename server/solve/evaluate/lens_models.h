// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/camera/intrinsics.h"
#include "server/solve/evaluate/held_out_choice.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// How far a camera's residuals depend on the distance from the principal point, in ten rings of as
// many markers: what a lens that its model does not hold leaves, too near to the middle here and
// too far from it there.
struct RingResiduals {
  double rms_px = 0;  // of the rings' mean residuals along the radius
  double share = 0;   // of the root mean square of the residuals along the radius
  // By the standard errors of the means over blocks of 2 s: about 1 by chance. 0: too few markers.
  double sigmas = 0;
};
// By camera. `solution`: with its rows.
std::vector<RingResiduals> MeasureRings(const RigSolution& solution);

// Another model describes the lens of a camera better than the one that was given.
struct BetterLens {
  size_t camera = 0;  // of the index
  // Held-out data say so beyond chance. Else the given one is wrong by the rings it leaves, and
  // this one leaves a smaller error.
  bool is_clear = false;
  Intrinsics intrinsics;
  HeldOutGain gain;  // of the camera's reprojection error, intrinsics refined in both models
  RingResiduals rings;
};

// For the cameras with rings in their residuals (2 sigmas, a tenth), the models Brown-Conrady,
// rational and fisheye are compared on data held out in long blocks of time, for all these cameras
// together. Another one is better where their error falls by 2 %, by two and a half standard errors
// or of the signed ranks, and that of the camera itself by one; where it has one direction for each
// pixel at which the camera saw the target; and focal lengths in the given ratio to 5 %. Of models
// that are equally good, the one with fewest coefficients.
//
// `by_camera`: each of these cameras by itself, on targets that the others place (placed_views.h),
// in groups of its own views instead of blocks of time. CANCELLED.
absl::StatusOr<std::vector<BetterLens>> FindBetterLenses(const RigObservations& rig,
                                                         const RigSolution& solution,
                                                         const RigSolveOptions& options,
                                                         bool by_camera = false);

// Names the model.
Finding FindingOf(const RigObservations& rig, const BetterLens& lens, bool is_used);

// The same observations, described by these lenses.
RigObservations WithLenses(const RigObservations& rig, const std::vector<BetterLens>& lenses);

}  // namespace rigcal::server
