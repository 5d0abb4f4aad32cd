// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/camera/intrinsics.h"
#include "server/solve/evaluate/held_out_choice.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {

// Another model describes the lens of a camera better than the one that was given.
struct BetterLens {
  size_t camera = 0;  // of the index
  Intrinsics intrinsics;
  HeldOutGain gain;  // of the camera's reprojection error, intrinsics refined in both models
};

// Cameras whose residuals depend on the distance from the middle of the image as none do whose lens
// is of the model that describes it. `solution`: with its rows.
std::vector<size_t> CamerasWithRings(const RigSolution& solution);

// For the cameras with rings in their residuals, the models Brown-Conrady, rational and fisheye are
// compared on data held out in long blocks of time. Another one is better where the camera's error
// falls by 2 % and by three standard errors, and it has one direction for each pixel where the
// camera saw the target. CANCELLED.
absl::StatusOr<std::vector<BetterLens>> FindBetterLenses(const RigObservations& rig,
                                                         const RigSolution& solution,
                                                         const RigSolveOptions& options);

// Names the model.
Finding FindingOf(const RigObservations& rig, const BetterLens& lens, bool is_used);

// The same observations, described by these lenses.
RigObservations WithLenses(const RigObservations& rig, const std::vector<BetterLens>& lenses);

}  // namespace rigcal::server
