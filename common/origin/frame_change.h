// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "common/calibration/calibration.h"
#include "common/calibration/camera_covariance.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal {

// A new rig frame, and what is not known of it. A small error is a rotation vector applied from the
// left (radians) and a translation (metres), in the new frame.
struct FrameChange {
  RigidTransform new_from_rig;
  // How the transform moves with the parameters of the calibration: a column for each row of its
  // covariance. Empty: it does not depend on them.
  Eigen::Matrix<double, 6, Eigen::Dynamic> by_parameters;
  // By everything else: the noise of the centres, the measurements.
  Eigen::Matrix<double, 6, 6> own_covariance = Eigen::Matrix<double, 6, 6>::Zero();

  // Of both.
  Eigen::Matrix<double, 6, 6> Covariance(const CameraCovariance& calibration) const;
};

// The same calibration in the new frame: poses, volume, static points, and the covariance, which
// then has the rows of every camera, because no camera's pose is exact any more
// (`reference_camera` is empty). Without a covariance it keeps none, and no camera has an
// uncertainty. The volume is the box, along the new axes, that holds the old one.
CalibrationResult ChangeFrame(const CalibrationResult& calibration, const FrameChange& change);

}  // namespace rigcal
