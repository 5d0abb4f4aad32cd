// SPDX-License-Identifier: Apache-2.0
#pragma once

// One marker of one view in eight instants: residual, weight and derivatives by the point. Part of
// the line bundle's kernel; see line_bundle_kernel.h.
#include "server/solve/bundle/line_bundle_kernel.h"
#include "server/solve/bundle/line_bundle_lanes.h"
#include "server/solve/bundle/marker_residual.h"

namespace rigcal::server::RIGCAL_KERNEL {

using Vec3 = server::Vec3<Lanes>;
using Line = LineInView<Lanes>;
using Measured = MeasuredMarker<Lanes>;
using Projected = ProjectedPoint<Lanes>;

RIGCAL_INLINE Vec3 LoadVec3(const double* from) {
  return {Load(from), Load(from + kLanes), Load(from + 2 * kLanes)};
}
RIGCAL_INLINE void StoreVec3(const Vec3& v, double* to) {
  Store(v.x, to), Store(v.y, to + kLanes), Store(v.z, to + 2 * kLanes);
}

// The target in eight instants, with an orthonormal basis of the directions' tangent planes
// (Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017).
struct TargetPose {
  Vec3 origin, direction, tangent[2];
};
RIGCAL_INLINE TargetPose LoadPose(const double* from) {
  TargetPose pose;
  pose.origin = LoadVec3(from);
  pose.direction = LoadVec3(from + 3 * kLanes);
  const Vec3& d = pose.direction;
  const Lanes one(1.0);
  const Lanes sign = Select(d.z < Lanes(0.0), Lanes(-1.0), one);
  const Lanes a = Lanes(-1.0) / (sign + d.z);
  const Lanes b = d.x * d.y * a;
  pose.tangent[0] = {one + sign * d.x * d.x * a, sign * b, -(sign * d.x)};
  pose.tangent[1] = {b, sign + d.y * d.y * a, -d.y};
  return pose;
}

// Sums of the robust cost, and of what must not be: used markers that cannot be seen.
struct CostSum {
  Lanes plain = Lanes(0.0);
  LogSum log;
  Lanes unseen = Lanes(0.0);

  RIGCAL_INLINE double Cost(const KernelInput& input) const {
    const double scale2 = input.loss_scale * input.loss_scale;
    return 0.5 * (input.robust ? scale2 * Sum(log.Value()) : Sum(plain));
  }
  RIGCAL_INLINE bool Valid() const { return !(Sum(unseen) > 0); }
};

// Adds rho(square) and returns rho'(square).
RIGCAL_INLINE Lanes AddLoss(const KernelInput& input, const Lanes& square, CostSum* sum) {
  const Lanes one(1.0);
  if (input.robust) {
    const Lanes factor = one + square * Lanes(1 / (input.loss_scale * input.loss_scale));
    sum->log.Add(factor);
    return one / factor;
  }
  sum->plain += square;
  return one;
}

RIGCAL_INLINE Measured LoadMeasured(const double* slot) {
  const auto at = [slot](int i) { return Load(slot + i * kLanes); };
  return {at(0), at(1), at(2), {at(3), at(4)}, {at(5), at(6)}};
}

// A marker's residual in sigmas and its weight under the loss.
struct MarkerResidual {
  Measured measured;
  Lanes r0, r1;
  Lanes weight;
};

// Of the loss's curvature along the residual, relative to the weight: not less, so that the matrix
// stays positive definite.
constexpr double kMinCurvature = 0.05;

// Replaces root and residual by ones of the same gradient whose square is the second derivative of
// the loss (Triggs et al., "Bundle Adjustment - A Modern Synthesis", 2000, section 4.3): along the
// residual, Cauchy's loss bends less than the weight alone says.
RIGCAL_INLINE void FollowCurvature(const KernelInput& input, const Lanes& square,
                                   MarkerResidual* marker) {
  const Lanes one(1.0), tiny(1e-300);
  Measured& root = marker->measured;
  const Lanes flat = Min(Lanes(2 / (input.loss_scale * input.loss_scale)) * marker->weight,
                         Lanes(1 - kMinCurvature) / Max(square, tiny));
  const Lanes r0 = marker->r0, r1 = marker->r1;
  const Lanes along = root.b * r0 + root.c * r1;
  const Lanes a = root.a * Sqrt(one - flat * r0 * r0);
  const Lanes b = (root.a * root.b - flat * root.a * r0 * along) / Max(a, tiny);
  const Lanes c = root.a * root.c * Sqrt(one - flat * square) / Max(a, tiny);
  const Mask full = (root.a > tiny) & (root.c > tiny);
  marker->r0 = Select(full, root.a * r0 / Max(a, tiny), r0);
  marker->r1 = Select(full, (along - b * marker->r0) / Max(c, tiny), r1);
  root.a = Select(full, a, root.a);
  root.b = Select(full, b, root.b);
  root.c = Select(full, c, root.c);
}

template <bool kPointDerivatives, bool kIntrinsicsDerivatives>
RIGCAL_INLINE MarkerResidual EvaluateMarker(const KernelInput& input,
                                            const ViewEstimate<double>& view, const double* slot,
                                            const Vec3& x_in_cam, const Lanes& dt,
                                            Projected* projected, CostSum* sum) {
  MarkerResidual marker;
  marker.measured = LoadMeasured(slot);
  const Lanes zero(0.0), one(1.0);
  const Mask used = marker.measured.a + marker.measured.c > zero;
  const Mask before = used & (x_in_cam.z > zero);
  const Lanes point[3] = {Select(before, x_in_cam.x, zero), Select(before, x_in_cam.y, zero),
                          Select(before, x_in_cam.z, one)};
  ProjectPoint<kPointDerivatives, kIntrinsicsDerivatives>(view.model, view.intrinsics, point,
                                                          projected);
  const Lanes own_dt = dt + Lanes(view.line_delay_s) * RowsLate(view, marker.measured.centre[1]);
  WhitenedResidual(marker.measured, *projected, own_dt, &marker.r0, &marker.r1);
  const Lanes square = marker.r0 * marker.r0 + marker.r1 * marker.r1;
  // A square that is not a number fails the comparison as well.
  const Mask seen = before & (projected->visible > zero) & (square < Lanes(1e300));
  sum->unseen += Select(used, one, zero) - Select(seen, one, zero);
  marker.weight = AddLoss(input, square, sum);
  if constexpr (kPointDerivatives) {
    if (input.robust && input.curved) FollowCurvature(input, square, &marker);
  }
  return marker;
}

}  // namespace rigcal::server::RIGCAL_KERNEL
