// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal {

// A marker while it stood still, from the means of its centres.
struct StillPoint {
  int place = 0;                // counts the places that the target was laid down at, from 0
  int marker = 0;               // of the target
  double from_s = 0, to_s = 0;  // rig time
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  // in the rig frame
  Eigen::Matrix3d noise_m2 = Eigen::Matrix3d::Zero();    // by the noise of the centres
  Eigen::Matrix3Xd gain;  // by the calibration's parameters (PointGain); no columns: no covariance
  int camera_count = 0;
  std::vector<PixelView> views;  // means of the centres
};

struct StillOptions {
  double min_still_s = 0.5;  // a place is where all markers rest for so long
  double max_move_m = 0.004;
  TriangulationOptions triangulation;
};

// Finds the places at which a target rests, in rows that also show how it is carried from one to
// the next. A place that comes again is the same one. FAILED_PRECONDITION: it rests nowhere.
// Errors of TriangulateRows and CheckCamerasAgree. `left_out_rows`: as in Triangulation, if not
// null.
absl::StatusOr<std::vector<StillPoint>> FindStillPoints(
    const CalibrationResult& calibration, const std::vector<CameraRows>& rows,
    const StillOptions& options, std::map<std::string, uint32_t>* left_out_rows = nullptr);

// The mean of a centre is worth so many rows at most: the errors of the pixel grid, the lens and
// the light are the same in every row of what does not move.
inline constexpr double kMaxRowsOfStillCentre = 25;

}  // namespace rigcal
