// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/marker_cost.h"

#include <Eigen/Geometry>
#include <cmath>

#include "common/camera/intrinsics_vector.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

bool IsFinite(const double* residuals) {
  return std::isfinite(residuals[0]) && std::isfinite(residuals[1]);
}

void StoreVec3(const Vec3<double>& v, double* to) { to[0] = v.x, to[1] = v.y, to[2] = v.z; }

// The derivative by x y z w of unit q, given that by a rotation vector applied from the left: along
// the sphere, on which alone q moves, half a rotation vector v is the step (v, 0) * q.
void StoreQuaternionDerivative(const Vec3<double>& d_rotation, const double* q, double* to) {
  const Vec3<double> axis = {q[0], q[1], q[2]};
  const Vec3<double> d_axis = 2.0 * (q[3] * d_rotation + Cross(d_rotation, axis));
  StoreVec3(d_axis, to);
  to[3] = -2 * Dot(axis, d_rotation);
}

}  // namespace

MarkerCost::MarkerCost(DistortionModel model, const BundleMarker& marker, double clock_time_s)
    : functor_{model, ToMeasured(marker), clock_time_s} {
  set_num_residuals(2);
  *mutable_parameter_block_sizes() = {4, 3, IntrinsicsSize(model), 1, 1, 1, 6};
}

bool MarkerCost::Evaluate(double const* const* parameters, double* residuals,
                          double** jacobians) const {
  const MarkerFunctor::Seen<double> seen = functor_.SeenFrom(parameters);
  ProjectedPoint<double> projected;
  if (jacobians == nullptr) {
    return functor_.Evaluate<false, false>(seen, &projected, residuals) && IsFinite(residuals);
  }
  if (!functor_.Evaluate<true, true>(seen, &projected, residuals) || !IsFinite(residuals)) {
    return false;
  }
  // Rows of a block's Jacobian are as long as the block.
  const auto block = [jacobians](MarkerBlock which) {
    return jacobians[static_cast<size_t>(which)];
  };
  Vec3<double> rows[2];
  PointDerivative(functor_.measured, projected, &rows[0], &rows[1]);
  const auto view_derivative = [&](int unknown, double* jacobian, int column, int columns) {
    ViewDerivative<true>(unknown, functor_.measured, projected, functor_.clock_time_s,
                         jacobian + column, jacobian + columns + column);
  };
  for (int i = 0; i < 2; ++i) {
    const Vec3<double>& row = rows[i];
    const Vec3<double> in_rig = TransposedTimes(seen.view.rotation, row);
    if (double* const jacobian = block(MarkerBlock::kRotation)) {
      const double* const q = parameters[static_cast<size_t>(MarkerBlock::kRotation)];
      const Vec3<double> rotated = {seen.x_in_cam.x - seen.view.translation[0],
                                    seen.x_in_cam.y - seen.view.translation[1],
                                    seen.x_in_cam.z - seen.view.translation[2]};
      StoreQuaternionDerivative(Cross(rotated, row), q, jacobian + 4 * i);
    }
    if (double* const jacobian = block(MarkerBlock::kTranslation)) {
      StoreVec3(row, jacobian + 3 * i);
    }
    if (double* const jacobian = block(MarkerBlock::kPosition)) {
      jacobian[i] = Dot(row, seen.line.slope);
    }
    if (double* const jacobian = block(MarkerBlock::kTarget)) {
      const double position = *parameters[static_cast<size_t>(MarkerBlock::kPosition)];
      StoreVec3(in_rig, jacobian + 6 * i);
      StoreVec3(position * in_rig, jacobian + 6 * i + 3);
    }
  }
  if (double* const jacobian = block(MarkerBlock::kOffset)) {
    view_derivative(ViewUnknowns::kOffset, jacobian, 0, 1);
  }
  if (double* const jacobian = block(MarkerBlock::kRate)) {
    view_derivative(ViewUnknowns::kRate, jacobian, 0, 1);
  }
  if (double* const jacobian = block(MarkerBlock::kIntrinsics)) {
    const int count = IntrinsicsSize(functor_.model);
    for (int k = 0; k < count; ++k) {
      view_derivative(ViewUnknowns::kFirstIntrinsic + k, jacobian, k, count);
    }
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
    const Eigen::Vector3d outward_in_cam = rotation * outward;
    if (jacobians[2 * i] != nullptr) {
      // The centre is -R^T t.
      const Eigen::Vector3d d_rotation = translation.cross(outward_in_cam);
      StoreQuaternionDerivative({d_rotation.x(), d_rotation.y(), d_rotation.z()}, parameters[2 * i],
                                jacobians[2 * i]);
    }
    if (jacobians[2 * i + 1] != nullptr) {
      Eigen::Map<Eigen::RowVector3d> d_translation(jacobians[2 * i + 1]);
      d_translation = -outward_in_cam.transpose();
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
