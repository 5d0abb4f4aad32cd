// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace rigcal::server {

// How points move when the parameters of a calibration are wrong, to first order: three rows (x, y,
// z) for each point, a column for each parameter; metres per unit.
using PointGainMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Is a point determined in every direction? `normal` is its information from all rays, with equal
// weights. Not where the rays are almost parallel (less than about 4 degrees apart), as between two
// cameras that face each other.
bool AreRaysApart(const Eigen::Matrix3d& normal);

// The part of the calibration alone in the errors of triangulated points: their images are exact.
struct CalibrationError {
  std::vector<double> sigma_m;  // by point: one sigma (3-D)
  double rms_m = 0;             // root mean square of sigma_m
  double median_m = 0;          // of sigma_m
  // In 95 % of the points the error is smaller than this, and as likely larger as smaller than
  // stated: the median of what calibrations as good as this one have.
  double p95_m = 0;
  double p95_bound_m = 0;  // 95 % of such calibrations have less in 95 % of the points
};

// Takes the best rigid motion of these points out of their gains (six degrees of freedom): which
// frame a rig has is a matter of choice. Points on one line keep theirs.
void RemoveRigidMotion(const std::vector<Eigen::Vector3d>& points_m, PointGainMatrix* gain);

// What that takes out is motions * taken. One point at least.
struct RigidMotion {
  Eigen::Matrix<double, Eigen::Dynamic, 6> motions;  // rows as the gain
  Eigen::Matrix<double, 6, Eigen::Dynamic> taken;    // columns as the gain; zero: not determined
};
RigidMotion FindRigidMotion(const std::vector<Eigen::Vector3d>& points_m,
                            const PointGainMatrix& gain);

// Free of the rig's frame (RemoveRigidMotion). `covariance` of the parameters. Deterministic:
// the probabilities are those of 64 draws from it with fixed random numbers. No point: zeros.
CalibrationError ComputeCalibrationError(const std::vector<Eigen::Vector3d>& points_m,
                                         PointGainMatrix gain, const Eigen::MatrixXd& covariance);

}  // namespace rigcal::server
