// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <string>

#include "common/calibration/calibration.h"
#include "common/calibration/camera_covariance.h"

namespace rigcal::testing {

// A calibration of cameras a, b, c, d on a ring, in the frame of a: known to 0.1 mm and 20
// microradians.
inline CalibrationResult RingResult() {
  CalibrationResult result;
  result.scale_known = true;
  result.reference_camera = "a";
  result.target.given.marker_positions_m = {0, 0.13, 0.39};
  result.wand_volume = WandVolume{{-1, -1, 2}, {1, 1, 4}};
  result.quality.grade = QualityGrade::kGood;
  const Eigen::Vector3d middle_m(0, 0, 3);
  for (int i = 0; i < 4; ++i) {
    CalibratedCamera camera;
    camera.camera = std::string(1, static_cast<char>('a' + i));
    camera.image_size_px = {1280, 1024};
    camera.intrinsics.fx_px = camera.intrinsics.fy_px = 1200;
    camera.intrinsics.cx_px = 640;
    camera.intrinsics.cy_px = 512;
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.6 * i, Eigen::Vector3d::UnitY()));
    camera.cam_from_rig = {turn, middle_m - turn * middle_m};
    camera.clock_id = camera.camera;
    camera.time_offset_estimated = true;
    CameraUncertainty uncertainty;
    uncertainty.time_offset_sigma_s = 1e-5;
    camera.uncertainty = uncertainty;
    result.cameras.push_back(camera);
  }
  Eigen::VectorXd variance(18);
  for (int i = 0; i < 18; ++i) variance[i] = i % 6 < 3 ? 4e-10 : 1e-8;
  result.camera_covariance = PackLowerTriangle(Eigen::MatrixXd(variance.asDiagonal()));
  return result;
}

// The camera turned by so much about its centre.
inline void TurnCamera(const std::string& name, double angle_rad, CalibrationResult* result) {
  for (CalibratedCamera& camera : result->cameras) {
    if (camera.camera != name) continue;
    RigidTransform turn;
    turn.rotation = Eigen::AngleAxisd(angle_rad, Eigen::Vector3d(1, 1, 0).normalized());
    camera.cam_from_rig = turn * camera.cam_from_rig;
  }
}

}  // namespace rigcal::testing
