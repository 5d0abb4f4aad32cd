// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/calibration/calibration.h"
#include "common/calibration/camera_covariance.h"

namespace rigcal {

// A point in the image of one camera.
struct PixelView {
  int camera = 0;  // index in the calibration
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
};

struct FittedPoint {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  // in the rig frame
  Eigen::Matrix3d noise_m2 = Eigen::Matrix3d::Zero();    // covariance by the centres' noise alone
  // By view: projected minus measured, and its length in sigmas of the centre.
  std::vector<Eigen::Vector2d> residual_px;
  std::vector<double> residual_sigmas;

  double WorstSigmas() const;
  double RmsPx() const;
};

// The point that two or more views see: least squares of the weighted reprojection error in pixels,
// from the point nearest all rays. None: fewer than two views, a centre for which the lens has no
// ray, rays that are less than a twentieth of a degree apart, or a point behind a camera.
std::optional<FittedPoint> FitPoint(const std::vector<CalibratedCamera>& cameras,
                                    const std::vector<PixelView>& views);

// How a fitted point moves with the parameters of the calibration, to first order: a column for
// each row of `covariance`, metres per unit.
Eigen::Matrix3Xd PointGain(const std::vector<CalibratedCamera>& cameras,
                           const CameraCovariance& covariance, const std::vector<PixelView>& views,
                           const FittedPoint& point);

}  // namespace rigcal
