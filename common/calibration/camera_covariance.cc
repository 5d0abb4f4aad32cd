// SPDX-License-Identifier: Apache-2.0
#include "common/calibration/camera_covariance.h"

#include "common/camera/intrinsics_vector.h"

namespace rigcal {

CameraCovariance UnpackCameraCovariance(const CalibrationResult& calibration) {
  CameraCovariance covariance;
  covariance.scale_sigma_rel = calibration.target.scale_sigma_rel;
  Eigen::Index rows = 0;
  for (const CalibratedCamera& camera : calibration.cameras) {
    CameraParameters own;
    own.first_row = rows;
    own.has_pose = camera.camera != calibration.reference_camera;
    if (camera.intrinsics_refined) own.intrinsic_count = IntrinsicsSize(camera.intrinsics.model);
    rows += own.rows();
    covariance.cameras.push_back(own);
  }
  const std::vector<double>& packed = calibration.camera_covariance;
  if (rows == 0 || packed.size() != static_cast<size_t>(rows * (rows + 1) / 2)) return covariance;
  covariance.matrix.resize(rows, rows);
  size_t next = 0;
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      covariance.matrix(i, j) = covariance.matrix(j, i) = packed[next++];
    }
  }
  return covariance;
}

std::vector<double> PackLowerTriangle(const Eigen::MatrixXd& matrix) {
  std::vector<double> packed;
  packed.reserve(static_cast<size_t>(matrix.rows() * (matrix.rows() + 1) / 2));
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) packed.push_back(0.5 * (matrix(i, j) + matrix(j, i)));
  }
  return packed;
}

}  // namespace rigcal
