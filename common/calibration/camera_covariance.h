// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "common/calibration/calibration.h"

namespace rigcal {

// Where the parameters of one camera are in the joint covariance of a calibration.
struct CameraParameters {
  Eigen::Index first_row = 0;
  bool has_pose = false;             // 6 rows: rotation vector in the camera frame, translation
  Eigen::Index intrinsic_count = 0;  // rows behind those

  Eigen::Index rows() const { return (has_pose ? 6 : 0) + intrinsic_count; }
};

// The joint covariance of the cameras of a calibration as a matrix (the order of its rows:
// CalibrationResult::camera_covariance), with the calibration's one sigma of scale.
struct CameraCovariance {
  std::vector<CameraParameters> cameras;  // as in the calibration
  Eigen::MatrixXd matrix;                 // symmetric
  double scale_sigma_rel = 0;
};

// No covariance is kept, or it does not go with these cameras: an empty matrix.
CameraCovariance UnpackCameraCovariance(const CalibrationResult& calibration);

// Lower triangle, row by row.
std::vector<double> PackLowerTriangle(const Eigen::MatrixXd& matrix);

}  // namespace rigcal
