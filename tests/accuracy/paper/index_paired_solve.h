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
// It starts from the poses of pairs of cameras (paired_start.h); how the paper finds its starting
// values is not repeated. The frame of the result is the first track's, offsets and rates are 0,
// and it has the residuals of this solve, and no covariance. INVALID_ARGUMENT: not a wand, or as
// StartFromPairs. FAILED_PRECONDITION: fewer than ten such instants, no start, or no convergence.
absl::StatusOr<CalibrationResult> SolveIndexPaired(const server::CalibrationInput& input);

}  // namespace rigcal::accuracy
