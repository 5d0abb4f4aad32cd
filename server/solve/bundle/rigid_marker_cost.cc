// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/rigid_marker_cost.h"

#include <cmath>

#include "common/camera/intrinsics_vector.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {

RigidMarkerCost::RigidMarkerCost(const BundleCamera& camera, const BundleMarker& marker,
                                 double clock_time_s)
    : functor_{{camera.model, ToMeasured(marker), clock_time_s, camera.middle_row}} {
  set_num_residuals(2);
  *mutable_parameter_block_sizes() = {4, 3, IntrinsicsSize(camera.model), 1, 1, 1, 3, 7};
}

bool RigidMarkerCost::Evaluate(double const* const* parameters, double* residuals,
                               double** jacobians) const {
  const MarkerFunctor& marker = functor_.marker;
  const MarkerFunctor::Seen<double> seen = functor_.SeenFrom(parameters);
  ProjectedPoint<double> projected;
  const auto is_finite = [residuals] {
    return std::isfinite(residuals[0]) && std::isfinite(residuals[1]);
  };
  if (jacobians == nullptr) {
    return marker.Evaluate<false, false>(seen, &projected, residuals) && is_finite();
  }
  const auto block = [jacobians](RigidMarkerBlock which) {
    return jacobians[static_cast<size_t>(which)];
  };
  const bool visible = block(RigidMarkerBlock::kIntrinsics) != nullptr
                           ? marker.Evaluate<true, true>(seen, &projected, residuals)
                           : marker.Evaluate<true, false>(seen, &projected, residuals);
  if (!visible || !is_finite()) return false;
  Vec3<double> rows[2];
  PointDerivative(marker.measured, projected, &rows[0], &rows[1]);
  StoreViewDerivatives(marker, seen, projected, rows, parameters, jacobians);
  const double* const target = parameters[static_cast<size_t>(RigidMarkerBlock::kTarget)];
  const Eigen::Matrix3d rig_from_target =
      Eigen::Map<const Eigen::Quaterniond>(target).toRotationMatrix();
  const Eigen::Vector3d arm =
      rig_from_target *
      Eigen::Map<const Eigen::Vector3d>(parameters[static_cast<size_t>(RigidMarkerBlock::kPoint)]);
  for (int i = 0; i < 2; ++i) {
    const Vec3<double> in_rig = TransposedTimes(seen.view.rotation, rows[i]);
    if (double* const jacobian = block(RigidMarkerBlock::kPoint)) {
      Eigen::Map<Eigen::RowVector3d>(jacobian + 3 * i) =
          Eigen::RowVector3d(in_rig.x, in_rig.y, in_rig.z) * rig_from_target;
    }
    if (double* const jacobian = block(RigidMarkerBlock::kTarget)) {
      StoreQuaternionDerivative(Cross(Vec3<double>{arm.x(), arm.y(), arm.z()}, in_rig), target,
                                jacobian + 7 * i);
      Eigen::Map<Eigen::RowVector3d>(jacobian + 7 * i + 4) =
          Eigen::RowVector3d(in_rig.x, in_rig.y, in_rig.z);
    }
  }
  return true;
}

}  // namespace rigcal::server
