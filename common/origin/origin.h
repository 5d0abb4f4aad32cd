// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/origin/frame_change.h"

namespace rigcal {

// A point as the rig measured it, in its frame.
struct OriginPoint {
  std::string name;  // for people: "marker 2 at place 1"
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Matrix3d noise_m2 = Eigen::Matrix3d::Zero();
  Eigen::Matrix3Xd gain;  // by the calibration's parameters; no columns: none are known
  double sigma_m = 0;     // one sigma of what was measured or assumed of the point in the room
};

// What a new frame was made from, and how well that fits.
struct OriginSolution {
  FrameChange change;
  struct Residual {
    std::string name;
    double residual_m = 0;  // distance from the plane (signed), or from the known point
    double sigma_m = 0;     // of the point by itself
  };
  std::vector<Residual> residuals;
  double rms_m = 0;
  Eigen::Vector3d rotation_sigma_rad = Eigen::Vector3d::Zero();  // about the new axes
  Eigen::Vector3d position_sigma_m = Eigen::Vector3d::Zero();    // of the new origin, new axes
  double lowest_camera_m = 0;                                    // above z = 0
  std::string lowest_camera;
};

struct OriginOptions {
  double max_residual_m = 0.005;  // root mean square
  double max_rotation_sigma_deg = 0.25;
  // Cameras are above the floor, or on the side that positive z says. Off: not looked at.
  bool cameras_above = true;
};

// Points on the floor, `height_m` above it (the radius of the spheres): z = 0 is the floor, z up
// towards the cameras, the origin below point `first`, x from there towards point `second`.
//
// FAILED_PRECONDITION, with numbers: fewer than three points, or all nearly on one line; a plane
// that goes through the cameras, so that nobody can tell which side is up; points that are not on
// one plane; a tilt that is not known well enough.
absl::StatusOr<OriginSolution> FloorOrigin(const CalibrationResult& calibration,
                                           const std::vector<OriginPoint>& points, size_t first,
                                           size_t second, double height_m,
                                           const OriginOptions& options);

// Points whose coordinates in the new frame are known, `known_m` by point.
//
// FAILED_PRECONDITION, with numbers: fewer than three points, or on one line; coordinates that are
// those of a mirror image; cameras below the plane of points that lie in z = 0; residuals that are
// too large, with the point that does not fit; a rotation that is not known well enough.
absl::StatusOr<OriginSolution> PointOrigin(const CalibrationResult& calibration,
                                           const std::vector<OriginPoint>& points,
                                           const std::vector<Eigen::Vector3d>& known_m,
                                           const OriginOptions& options);

// z against `down` (a direction in the rig frame, any length), by the smallest turn; the origin
// stays. INVALID_ARGUMENT: no direction.
absl::StatusOr<OriginSolution> LevelOrigin(const CalibrationResult& calibration,
                                           const Eigen::Vector3d& down);

// A given transform, taken as exact.
OriginSolution GivenOrigin(const CalibrationResult& calibration,
                           const RigidTransform& new_from_rig);

}  // namespace rigcal
