// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/camera_covariance.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal {

// A length that was measured in the room and that the calibration has, too.
struct ScaleSource {
  std::string name;    // "distance left to right"
  double given_m = 0;  // with a rule
  double given_sigma_m = 0;
  double measured_m = 0;    // in the calibration
  double noise_m = 0;       // one sigma of that, by the centres' noise
  Eigen::RowVectorXd gain;  // by the calibration's parameters, scale excluded; none: not known
};

struct ScaleResidual {
  std::string name;
  // The factor by which this source alone would change every length, minus 1; one sigma of it, with
  // what the shape of the rig adds.
  double own_change_rel = 0, own_sigma_rel = 0;
  // Against what the others together say: the ratio minus 1, and its logarithm in sigmas. Zeros for a
  // single source.
  double from_others_rel = 0, from_others_sigmas = 0;
};

struct ScaleFusion {
  double factor = 1;                     // for every length of the calibration
  double sigma_rel = 0;                  // one sigma of it
  std::vector<ScaleResidual> residuals;  // by source
  int odd = -1;                          // the source that disagrees; -1: none
  // Two sources disagree, and the others do not say which of them is wrong: these.
  bool undecided = false;
  int suspects[2] = {-1, -1};
};

// A source is odd beyond so many sigmas from the others: by chance once in 2 000.
inline constexpr double kOddSourceSigmas = 3.5;
// Two sources are told apart where leaving out the one makes the rest fit so much better than
// leaving out the other: a difference of chi-square, three sigmas.
inline constexpr double kDecidedChiSquare = 9;

// Generalised least squares of the logarithms of all ratios given / measured. Lengths of one
// calibration share the errors of its shape: `covariance` says how much. At least one source, all
// lengths positive. What disagrees is counted in: leave it out and fuse again.
ScaleFusion FuseScales(const std::vector<ScaleSource>& sources, const CameraCovariance& covariance);

// The wand (or other target) by which the calibration has its scale. FAILED_PRECONDITION: it does
// not say how well its scale is known.
absl::StatusOr<ScaleSource> ScaleOfTarget(const CalibrationResult& calibration);

// The distance between the centres of two cameras. INVALID_ARGUMENT: there is no such camera, or
// it is the same one.
absl::StatusOr<ScaleSource> ScaleOfCameras(const CalibrationResult& calibration,
                                           const CameraCovariance& covariance, const std::string& a,
                                           const std::string& b, double given_m,
                                           double given_sigma_m);

// The distance between two markers, such as the ends of a scale bar, over all instants that have
// both. FAILED_PRECONDITION: fewer than 5 have.
absl::StatusOr<ScaleSource> ScaleOfMarkers(const CalibrationResult& calibration,
                                           const CameraCovariance& covariance,
                                           const Triangulation& triangulation, int marker_a,
                                           int marker_b, double given_m, double given_sigma_m);

// The calibration with every length times `factor`, its scale known to `sigma_rel`.
CalibrationResult Rescale(const CalibrationResult& calibration, double factor, double sigma_rel);

}  // namespace rigcal
