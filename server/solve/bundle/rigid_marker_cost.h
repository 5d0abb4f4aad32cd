// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>

#include "server/solve/bundle/marker_cost.h"

namespace rigcal::server {

// The residual of one marker of a rigid target (marker_residual.h) for Ceres: that of MarkerCost
// with another way to the point, x_in_rig = R * point + origin. Two residuals; parameter blocks, in
// this order:
//   rotation (4)     of cam_from_rig, Eigen's storage x y z w
//   translation (3)  of cam_from_rig, metres
//   intrinsics (n)   fx fy cx cy and the coefficients of `model`
//   offset (1)       of the clock, seconds
//   rate (1)         of the clock, s/s
//   line delay (1)   of the camera, seconds
//   point (3)        of the marker in the target, metres
//   target (7)       R = rig_from_target, x y z w; origin in the rig (3, metres)
// Evaluation fails for a marker the camera cannot see, as there.
enum class RigidMarkerBlock : uint8_t {
  kRotation,
  kTranslation,
  kIntrinsics,
  kOffset,
  kRate,
  kLineDelay,
  kPoint,
  kTarget
};
inline constexpr size_t kRigidMarkerBlockCount = 8;

// With T = double the residual, with Ceres's Jets automatic differentiation.
struct RigidMarkerFunctor {
  MarkerFunctor marker;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* intrinsics, const T* offset,
                  const T* rate, const T* line_delay, const T* point, const T* target,
                  T* residuals) const {
    const T* const blocks[kRigidMarkerBlockCount] = {rotation, translation, intrinsics, offset,
                                                     rate,     line_delay,  point,      target};
    ProjectedPoint<T> projected;
    return marker.Evaluate<false, false>(SeenFrom(blocks), &projected, residuals);
  }

  template <typename T>
  MarkerFunctor::Seen<T> SeenFrom(T const* const* blocks) const {
    const T* const target = blocks[static_cast<size_t>(RigidMarkerBlock::kTarget)];
    const Eigen::Vector3<T> x_in_rig =
        Eigen::Map<const Eigen::Quaternion<T>>(target) *
            Eigen::Map<const Eigen::Vector3<T>>(
                blocks[static_cast<size_t>(RigidMarkerBlock::kPoint)]) +
        Eigen::Map<const Eigen::Vector3<T>>(target + 4);
    return marker.SeenAt(blocks, Vec3<T>{x_in_rig.x(), x_in_rig.y(), x_in_rig.z()});
  }
};

// The same with analytic derivatives.
class RigidMarkerCost final : public ceres::CostFunction {
 public:
  RigidMarkerCost(const BundleCamera& camera, const BundleMarker& marker, double clock_time_s);

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  RigidMarkerFunctor functor_;
};

}  // namespace rigcal::server
