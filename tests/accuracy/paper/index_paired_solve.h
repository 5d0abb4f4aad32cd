// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "server/solve/calibrate.h"

namespace rigcal::accuracy {

// A wand solved as the eWand paper describes it (Gossard, Ziegler et al., ICRA 2024), written after
// that description: row i of every camera is one instant, and counts if all cameras see all markers
// in it; least squares of the reprojection error in pixels over the poses of cameras and wand, all
// centres alike; spans, intrinsics and clocks as given; no loss, nothing left out. Ceres
// (tests/bench/reference_bundle.h).
//
// Not repeated is how the paper finds its starting values: cameras start where `start` has them,
// which is a calibration of the same cameras. The result has its frame, offsets and rates of 0 and
// the residuals of this solve, and no covariance. INVALID_ARGUMENT: not a wand, or a camera that
// `start` lacks. FAILED_PRECONDITION: fewer than ten such instants, or no
// convergence.
absl::StatusOr<CalibrationResult> SolveIndexPaired(const server::CalibrationInput& input,
                                                   const CalibrationResult& start);

}  // namespace rigcal::accuracy
