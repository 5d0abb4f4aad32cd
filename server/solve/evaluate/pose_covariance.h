// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal::server {

// The camera poses of a calibration with their joint covariance. Where intrinsics were refined,
// their uncertainty is a part of that of the poses, unless PosesOf is told otherwise.
struct RigPoses {
  // A value of a lens with a row of its own.
  struct Lens {
    std::string camera;
    int component = 0;  // of its IntrinsicsVector
    double value = 0;
  };
  std::vector<std::string> cameras;          // sorted
  std::vector<RigidTransform> cam_from_rig;  // metres
  // Six rows for each camera: rotation vector in the camera frame (applied from the left, radians)
  // and translation of cam_from_rig (metres), the scale taken as exact. Zero for the camera that
  // is held fixed. Behind them one row for each of `lenses`.
  Eigen::MatrixXd covariance;
  std::vector<Lens> lenses;
  double scale_sigma_rel = 0;

  // -1: it has no such camera.
  int Find(const std::string& camera) const;
};

// How the intrinsics that a calibration has refined itself are treated.
enum class LensRows : uint8_t {
  kInPoses,  // their uncertainty is a part of that of the poses
  kOwn,      // they have rows of their own
};

// `given`: cameras whose intrinsics are taken as exact. So are they where poses are compared that
// two solves found with the same intrinsics: an error of these moves both alike.
// FAILED_PRECONDITION: the scale is not known, or there is no covariance.
absl::StatusOr<RigPoses> PosesOf(const CalibrationResult& calibration,
                                 const std::vector<std::string>& given = {},
                                 LensRows lens_rows = LensRows::kInPoses);

// The covariance with another camera held fixed: each camera's change is reduced by that of the rig
// frame which the fixed one would otherwise have made.
void HoldFixed(size_t camera, RigPoses* poses);

// All poses in the rig frame in which this camera has that pose. It stays fixed where it
// was held fixed.
void MoveToFrameOf(size_t camera, const RigidTransform& cam_from_rig, RigPoses* poses);

}  // namespace rigcal::server
