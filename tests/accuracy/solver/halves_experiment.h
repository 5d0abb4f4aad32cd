// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/solve/calibrate.h"

namespace rigcal::accuracy {

// How a recording is cut into parts by time.
struct PartsOptions {
  int count = 2;
  // 0: one run of time for each part. Else blocks of this length, given to the parts in turn.
  double block_s = 0;
};

// The rows of one part; `part` in [0, count). Cut by the cameras' own stamps.
server::CalibrationInput TakePart(const server::CalibrationInput& input,
                                  const PartsOptions& options, int part);

// Differences between two calibrations of one rig that share no row, and what they state of
// themselves. Poses are relative to the reference camera, in lengths of the target.
struct PartsDifference {
  // (difference)^2 / (sum of the stated variances), by value.
  std::vector<double> position, rotation, intrinsics, time_offset;
  // Of triangulated points, after the best rigid motion and at one scale: root mean square of the
  // 3-D differences, and what both covariances together predict for it.
  double points_rms_m = 0, predicted_rms_m = 0;
  // The median point and the 95th percentile.
  double points_median_m = 0, points_p95_m = 0;
};

// Points: every marker that the calibration `whole` placed. Each is projected into the cameras by
// `whole` and triangulated by `a` and by `b`.
// INTERNAL: the calibrations have other cameras, or state no uncertainty.
absl::StatusOr<PartsDifference> CompareParts(const CalibrationResult& a, const CalibrationResult& b,
                                             const CalibrationResult& whole,
                                             const std::vector<Eigen::Vector3d>& points_m);

// A recording, calibrated whole and in parts.
struct PartsTrial {
  std::vector<CalibrationResult> parts;
  std::vector<std::pair<int, int>> pairs;    // of parts
  std::vector<PartsDifference> differences;  // by pair
};
absl::StatusOr<PartsTrial> RunParts(const server::CalibrationInput& input,
                                    const PartsOptions& options, const CalibrationResult& whole,
                                    const std::vector<Eigen::Vector3d>& points_m);

// How straight a wand of three markers is: the middle one against the line through the ends, each
// triangulated by itself where three cameras see it.
struct Straightness {
  int count = 0;     // of instants
  double rms_m = 0;  // of the distance from the line
  // Correlation of the offset (as a vector of the rig) with that of the next instant, and with that
  // 20 instants later. Noise has none.
  double next = 0, later = 0;
};
Straightness MeasureStraightness(const server::RigSolution& solution);

// Places of the markers of a calibration.
std::vector<Eigen::Vector3d> PlacedMarkers(const server::RigSolution& solution);

}  // namespace rigcal::accuracy
