// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/marker_cost.h"

#include <cmath>

#include "common/camera/intrinsics_vector.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

bool IsFinite(const double* residuals) {
  return std::isfinite(residuals[0]) && std::isfinite(residuals[1]);
}

void StoreVec3(const Vec3<double>& v, double* to) { to[0] = v.x, to[1] = v.y, to[2] = v.z; }

}  // namespace

void StoreQuaternionDerivative(const Vec3<double>& d_rotation, const double* q, double* to) {
  const Vec3<double> axis = {q[0], q[1], q[2]};
  const Vec3<double> d_axis = 2.0 * (q[3] * d_rotation + Cross(d_rotation, axis));
  StoreVec3(d_axis, to);
  to[3] = -2 * Dot(axis, d_rotation);
}

void StoreViewDerivatives(const MarkerFunctor& functor, const MarkerFunctor::Seen<double>& seen,
                          const ProjectedPoint<double>& projected, const Vec3<double>* rows,
                          double const* const* parameters, double** jacobians) {
  // Rows of a block's Jacobian are as long as the block.
  const auto block = [jacobians](MarkerBlock which) {
    return jacobians[static_cast<size_t>(which)];
  };
  const auto view_derivative = [&](int unknown, double* jacobian, int column, int columns) {
    ViewDerivative<true>(unknown, functor.measured, projected, functor.clock_time_s,
                         RowsLate(seen.view, functor.measured.centre[1]), jacobian + column,
                         jacobian + columns + column);
  };
  for (int i = 0; i < 2; ++i) {
    if (double* const jacobian = block(MarkerBlock::kRotation)) {
      const double* const q = parameters[static_cast<size_t>(MarkerBlock::kRotation)];
      const Vec3<double> rotated = {seen.x_in_cam.x - seen.view.translation[0],
                                    seen.x_in_cam.y - seen.view.translation[1],
                                    seen.x_in_cam.z - seen.view.translation[2]};
      StoreQuaternionDerivative(Cross(rotated, rows[i]), q, jacobian + 4 * i);
    }
    if (double* const jacobian = block(MarkerBlock::kTranslation)) {
      StoreVec3(rows[i], jacobian + 3 * i);
    }
  }
  if (double* const jacobian = block(MarkerBlock::kOffset)) {
    view_derivative(ViewUnknowns::kOffset, jacobian, 0, 1);
  }
  if (double* const jacobian = block(MarkerBlock::kRate)) {
    view_derivative(ViewUnknowns::kRate, jacobian, 0, 1);
  }
  if (double* const jacobian = block(MarkerBlock::kLineDelay)) {
    view_derivative(ViewUnknowns::kLineDelay, jacobian, 0, 1);
  }
  if (double* const jacobian = block(MarkerBlock::kIntrinsics)) {
    const int count = IntrinsicsSize(functor.model);
    for (int k = 0; k < count; ++k) {
      view_derivative(ViewUnknowns::kFirstIntrinsic + k, jacobian, k, count);
    }
  }
}

MarkerCost::MarkerCost(const BundleCamera& camera, const BundleMarker& marker, double clock_time_s)
    : functor_{camera.model, ToMeasured(marker), clock_time_s, camera.middle_row} {
  set_num_residuals(2);
  *mutable_parameter_block_sizes() = {4, 3, IntrinsicsSize(camera.model), 1, 1, 1, 1, 6};
}

bool MarkerCost::Evaluate(double const* const* parameters, double* residuals,
                          double** jacobians) const {
  const MarkerFunctor::Seen<double> seen = functor_.SeenFrom(parameters);
  ProjectedPoint<double> projected;
  if (jacobians == nullptr) {
    return functor_.Evaluate<false, false>(seen, &projected, residuals) && IsFinite(residuals);
  }
  const auto block = [jacobians](MarkerBlock which) {
    return jacobians[static_cast<size_t>(which)];
  };
  const bool visible = block(MarkerBlock::kIntrinsics) != nullptr
                           ? functor_.Evaluate<true, true>(seen, &projected, residuals)
                           : functor_.Evaluate<true, false>(seen, &projected, residuals);
  if (!visible || !IsFinite(residuals)) return false;
  Vec3<double> rows[2];
  PointDerivative(functor_.measured, projected, &rows[0], &rows[1]);
  StoreViewDerivatives(functor_, seen, projected, rows, parameters, jacobians);
  for (int i = 0; i < 2; ++i) {
    if (double* const jacobian = block(MarkerBlock::kPosition)) {
      jacobian[i] = Dot(rows[i], seen.line.slope);
    }
    if (double* const jacobian = block(MarkerBlock::kTarget)) {
      const Vec3<double> in_rig = TransposedTimes(seen.view.rotation, rows[i]);
      const double position = *parameters[static_cast<size_t>(MarkerBlock::kPosition)];
      StoreVec3(in_rig, jacobian + 6 * i);
      StoreVec3(position * in_rig, jacobian + 6 * i + 3);
    }
  }
  return true;
}

}  // namespace rigcal::server
