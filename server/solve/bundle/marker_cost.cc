// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/marker_cost.h"

#include <Eigen/Geometry>

#include "server/solve/bundle/projection_jacobian.h"

namespace rigcal::server {
namespace {

template <int kColumns>
using RowMajor2 =
    Eigen::Matrix<double, 2, kColumns, kColumns == 1 ? Eigen::ColMajor : Eigen::RowMajor>;

// A Jacobian of two rows as Ceres stores it.
template <int kColumns>
Eigen::Map<RowMajor2<kColumns>> Rows(double* jacobian) {
  return Eigen::Map<RowMajor2<kColumns>>(jacobian);
}

enum Block { kRotation, kTranslation, kIntrinsics, kOffset, kRate, kPosition, kTarget };

// d (R(q) v) / d (x y z w), for R(q) v = v + 2 w (a x v) + 2 a x (a x v), a = (x y z).
Eigen::Matrix<double, 3, 4> RotatedByQuaternion(const Eigen::Vector3d& a, double w,
                                                const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;  // v x
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  Eigen::Matrix<double, 3, 4> jacobian;
  jacobian.leftCols<3>() = -2 * w * cross + 2 * a.dot(v) * Eigen::Matrix3d::Identity() +
                           2 * a * v.transpose() - 4 * v * a.transpose();
  jacobian.col(3) = 2 * a.cross(v);
  return jacobian;
}

}  // namespace

MarkerCost::MarkerCost(DistortionModel model, const BundleMarker& marker, double clock_time_s)
    : model_(model),
      centre_px_(marker.centre_px),
      velocity_px_s_(marker.velocity_px_s),
      sqrt_information_(marker.sqrt_information),
      clock_time_s_(clock_time_s) {
  set_num_residuals(2);
  *mutable_parameter_block_sizes() = {4, 3, IntrinsicsSize(model), 1, 1, 1, 6};
}

bool MarkerCost::Evaluate(double const* const* parameters, double* residuals,
                          double** jacobians) const {
  const Eigen::Map<const Eigen::Quaterniond> rotation(parameters[kRotation]);
  const Eigen::Map<const Eigen::Vector3d> translation(parameters[kTranslation]);
  const Eigen::Map<const Eigen::Vector3d> origin(parameters[kTarget]);
  const Eigen::Map<const Eigen::Vector3d> direction(parameters[kTarget] + 3);
  const double position = parameters[kPosition][0];
  const double offset_s = parameters[kOffset][0] + parameters[kRate][0] * clock_time_s_;
  const Eigen::Vector3d x_in_rig = origin + position * direction;
  const Eigen::Matrix3d rotation_matrix = rotation.toRotationMatrix();
  const Eigen::Vector3d x_in_cam = rotation_matrix * x_in_rig + translation;
  const bool with_jacobians = jacobians != nullptr;
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> d_point;
  IntrinsicsJacobian d_intrinsics;
  if (!ProjectWithJacobian(
          model_, parameters[kIntrinsics], x_in_cam, &pixel, with_jacobians ? &d_point : nullptr,
          with_jacobians && jacobians[kIntrinsics] != nullptr ? &d_intrinsics : nullptr)) {
    return false;
  }
  Eigen::Map<Eigen::Vector2d> residual(residuals);
  residual = sqrt_information_ * (pixel - centre_px_ + offset_s * velocity_px_s_);
  if (!with_jacobians) return true;

  const Eigen::Matrix<double, 2, 3> d_cam = sqrt_information_ * d_point;
  const Eigen::Matrix<double, 2, 3> d_rig = d_cam * rotation_matrix;
  const Eigen::Vector2d d_offset = sqrt_information_ * velocity_px_s_;
  if (jacobians[kRotation] != nullptr) {
    const Eigen::Vector3d axis(rotation.x(), rotation.y(), rotation.z());
    Rows<4>(jacobians[kRotation]) = d_cam * RotatedByQuaternion(axis, rotation.w(), x_in_rig);
  }
  if (jacobians[kTranslation] != nullptr) {
    Rows<3>(jacobians[kTranslation]) = d_cam;
  }
  if (jacobians[kIntrinsics] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>>(
        jacobians[kIntrinsics], 2, d_intrinsics.cols()) = sqrt_information_ * d_intrinsics;
  }
  if (jacobians[kOffset] != nullptr) {
    Rows<1>(jacobians[kOffset]) = d_offset;
  }
  if (jacobians[kRate] != nullptr) {
    Rows<1>(jacobians[kRate]) = clock_time_s_ * d_offset;
  }
  if (jacobians[kPosition] != nullptr) {
    Rows<1>(jacobians[kPosition]) = d_rig * direction;
  }
  if (jacobians[kTarget] != nullptr) {
    Eigen::Map<RowMajor2<6>> d_target(jacobians[kTarget]);
    d_target.leftCols<3>() = d_rig;
    d_target.rightCols<3>() = position * d_rig;
  }
  return true;
}

ScalarPriorCost::ScalarPriorCost(double mean, double sigma) : mean_(mean), sigma_(sigma) {
  set_num_residuals(1);
  *mutable_parameter_block_sizes() = {1};
}

bool ScalarPriorCost::Evaluate(double const* const* parameters, double* residuals,
                               double** jacobians) const {
  residuals[0] = (parameters[0][0] - mean_) / sigma_;
  if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = 1 / sigma_;
  return true;
}

SpanPriorCost::SpanPriorCost(double span_m, double sigma_m) : span_m_(span_m), sigma_m_(sigma_m) {
  set_num_residuals(1);
  *mutable_parameter_block_sizes() = {1, 1};
}

bool SpanPriorCost::Evaluate(double const* const* parameters, double* residuals,
                             double** jacobians) const {
  residuals[0] = (parameters[1][0] - parameters[0][0] - span_m_) / sigma_m_;
  if (jacobians != nullptr) {
    if (jacobians[0] != nullptr) jacobians[0][0] = -1 / sigma_m_;
    if (jacobians[1] != nullptr) jacobians[1][0] = 1 / sigma_m_;
  }
  return true;
}

DistancePriorCost::DistancePriorCost(double distance_m, double sigma_m)
    : distance_m_(distance_m), sigma_m_(sigma_m) {
  set_num_residuals(1);
  *mutable_parameter_block_sizes() = {4, 3, 4, 3};
}

bool DistancePriorCost::Evaluate(double const* const* parameters, double* residuals,
                                 double** jacobians) const {
  Eigen::Vector3d centres[2];
  for (int i = 0; i < 2; ++i) {
    const Eigen::Map<const Eigen::Quaterniond> rotation(parameters[2 * i]);
    const Eigen::Map<const Eigen::Vector3d> translation(parameters[2 * i + 1]);
    centres[i] = -(rotation.toRotationMatrix().transpose() * translation);
  }
  const Eigen::Vector3d difference = centres[1] - centres[0];
  const double distance_m = difference.norm();
  if (!(distance_m > 0)) return false;
  residuals[0] = (distance_m - distance_m_) / sigma_m_;
  if (jacobians == nullptr) return true;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Map<const Eigen::Quaterniond> rotation(parameters[2 * i]);
    const Eigen::Map<const Eigen::Vector3d> translation(parameters[2 * i + 1]);
    // Along which the centre makes the distance longer.
    const Eigen::Vector3d outward = (i == 0 ? -1 : 1) / (distance_m * sigma_m_) * difference;
    if (jacobians[2 * i] != nullptr) {
      // The centre is -R(conj q) t.
      Eigen::Matrix<double, 3, 4> d_centre =
          RotatedByQuaternion(-rotation.vec(), rotation.w(), translation);
      d_centre.col(3) *= -1;
      Eigen::Map<Eigen::RowVector4d> d_rotation(jacobians[2 * i]);
      d_rotation = outward.transpose() * d_centre;
    }
    if (jacobians[2 * i + 1] != nullptr) {
      Eigen::Map<Eigen::RowVector3d> d_translation(jacobians[2 * i + 1]);
      d_translation = -(rotation.toRotationMatrix() * outward).transpose();
    }
  }
  return true;
}

VectorPriorCost::VectorPriorCost(const IntrinsicsVector& mean, const IntrinsicsVector& sigma)
    : mean_(mean), inverse_sigma_(IntrinsicsVector::Zero(sigma.size())) {
  for (Eigen::Index i = 0; i < sigma.size(); ++i) {
    if (sigma[i] > 0) inverse_sigma_[i] = 1 / sigma[i];
  }
  const int size = static_cast<int>(mean.size());
  set_num_residuals(size);
  *mutable_parameter_block_sizes() = {size};
}

bool VectorPriorCost::Evaluate(double const* const* parameters, double* residuals,
                               double** jacobians) const {
  const Eigen::Index size = mean_.size();
  const Eigen::Map<const Eigen::VectorXd> values(parameters[0], size);
  Eigen::Map<Eigen::VectorXd>(residuals, size) = inverse_sigma_.cwiseProduct(values - mean_);
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    Eigen::Map<Eigen::MatrixXd>(jacobians[0], size, size) = inverse_sigma_.asDiagonal();
  }
  return true;
}

}  // namespace rigcal::server
