// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "server/solve/calibrate.h"

namespace rigcal::accuracy {

struct SplineSolveOptions {
  double step_s = 0.07;     // from one knot to the next
  double loss_px = 1;       // scale of Cauchy's loss
  double pairing_hz = 50;   // rows that are nearest to one period start as one instant
  int rounds = 4;           // knots are chosen again after each, by the offsets found
  int max_iterations = 30;  // of a round
  double settled_s = 1e-6;  // offsets that change by less need no further round
};

// A stand-in for kalibr's method on a rigid target, written after Furgale, Barfoot and Sibley
// (ICRA 2012) and Furgale, Rehder and Siegwart (IROS 2013): the target's pose over time is a
// uniform B-spline of order 6; poses of cameras, each camera's clock offset and the spline's knots
// minimise the reprojection error in pixels, all centres alike, under Cauchy's loss. Ceres. It is
// not kalibr's program. Differences: a knot holds a translation and a quaternion of any length, of
// which the direction counts, not a rotation vector, so that the target may turn around; lenses are
// held as given; knots that no view supports are held together by their third differences.
//
// It starts from the poses of pairs of cameras (paired_start.h). The frame and the clock of the
// result are the first track's; it has the residuals of this solve and no covariance.
// INVALID_ARGUMENT: not a rigid target, no rows, or as StartFromPairs. FAILED_PRECONDITION: fewer
// than ten views that two cameras have at once, or no start.
absl::StatusOr<CalibrationResult> SolveSpline(const server::CalibrationInput& input,
                                              const SplineSolveOptions& options = {});

}  // namespace rigcal::accuracy
