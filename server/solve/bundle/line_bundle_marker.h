// SPDX-License-Identifier: Apache-2.0
#pragma once

// One marker of one view in eight instants: residual, weight and derivatives by the point. Part of
// the line bundle's kernel; see line_bundle_kernel.h.
#include "server/solve/bundle/line_bundle_kernel.h"
#include "server/solve/bundle/line_bundle_lanes.h"
#include "server/solve/bundle/line_bundle_projection.h"

namespace rigcal::server::RIGCAL_KERNEL {

struct Vec3 {
  Lanes x, y, z;
};
RIGCAL_INLINE Vec3 operator+(const Vec3& a, const Vec3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
RIGCAL_INLINE Vec3 operator*(const Lanes& s, const Vec3& v) { return {s * v.x, s * v.y, s * v.z}; }
RIGCAL_INLINE void operator+=(Vec3& a, const Vec3& b) { a = a + b; }
RIGCAL_INLINE Lanes Dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
RIGCAL_INLINE Vec3 Cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
RIGCAL_INLINE Vec3 LoadVec3(const double* from) {
  return {Load(from), Load(from + kLanes), Load(from + 2 * kLanes)};
}
RIGCAL_INLINE void StoreVec3(const Vec3& v, double* to) {
  Store(v.x, to), Store(v.y, to + kLanes), Store(v.z, to + 2 * kLanes);
}
// m v and m^T v for a 3x3 matrix, row by row.
RIGCAL_INLINE Vec3 Times(const double* m, const Vec3& v) {
  return {Lanes(m[0]) * v.x + Lanes(m[1]) * v.y + Lanes(m[2]) * v.z,
          Lanes(m[3]) * v.x + Lanes(m[4]) * v.y + Lanes(m[5]) * v.z,
          Lanes(m[6]) * v.x + Lanes(m[7]) * v.y + Lanes(m[8]) * v.z};
}
RIGCAL_INLINE Vec3 TransposedTimes(const double* m, const Vec3& v) {
  return {Lanes(m[0]) * v.x + Lanes(m[3]) * v.y + Lanes(m[6]) * v.z,
          Lanes(m[1]) * v.x + Lanes(m[4]) * v.y + Lanes(m[7]) * v.z,
          Lanes(m[2]) * v.x + Lanes(m[5]) * v.y + Lanes(m[8]) * v.z};
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

// The line as a view sees it: point of marker m at start + s_m * slope.
struct LineInView {
  Vec3 start;   // R o + t
  Vec3 origin;  // R o
  Vec3 slope;   // R d
};
RIGCAL_INLINE LineInView SeeLine(const KernelView& view, const Vec3& origin,
                                 const Vec3& direction) {
  LineInView line;
  line.origin = Times(view.rotation, origin);
  line.slope = Times(view.rotation, direction);
  const double* t = view.translation;
  line.start = line.origin + Vec3{Lanes(t[0]), Lanes(t[1]), Lanes(t[2])};
  return line;
}

// Sums of the robust cost, and of what must not be: used markers that cannot be seen.
struct CostSum {
  Lanes plain = Lanes(0.0);
  LogSum log;
  Lanes unseen = Lanes(0.0);

  RIGCAL_INLINE double Cost(const KernelInput& input) const {
    const double scale2 = input.loss_scale * input.loss_scale;
    return 0.5 * (input.loss == KernelLoss::kCauchy ? scale2 * Sum(log.Value()) : Sum(plain));
  }
  RIGCAL_INLINE bool Valid() const { return !(Sum(unseen) > 0); }
};

// Adds rho(square) and returns rho'(square).
RIGCAL_INLINE Lanes AddLoss(const KernelInput& input, const Lanes& square, CostSum* sum) {
  const Lanes one(1.0);
  switch (input.loss) {
    case KernelLoss::kNone:
      break;
    case KernelLoss::kHuber: {
      const Lanes scale(input.loss_scale), scale2 = scale * scale;
      const auto outlying = square > scale2;
      const Lanes root = Sqrt(Max(square, scale2));
      sum->plain += Select(outlying, Lanes(2.0) * scale * root - scale2, square);
      return Select(outlying, scale / root, one);
    }
    case KernelLoss::kCauchy: {
      const Lanes factor = one + square * Lanes(1 / (input.loss_scale * input.loss_scale));
      sum->log.Add(factor);
      return one / factor;
    }
  }
  sum->plain += square;
  return one;
}

// A marker's residual in sigmas, r = [a b; 0 c] (p - u + dt u').
struct MarkerResidual {
  Lanes a, b, c;
  Lanes r0, r1;
  Lanes weight;
};

template <bool kPointDerivatives, bool kIntrinsicsDerivatives>
RIGCAL_INLINE MarkerResidual EvaluateMarker(const KernelInput& input, const KernelView& view,
                                            const double* slot, const Vec3& x_in_cam,
                                            const Lanes& dt, ProjectedPoint<Lanes>* projected,
                                            CostSum* sum) {
  MarkerResidual marker;
  marker.a = Load(slot), marker.b = Load(slot + kLanes), marker.c = Load(slot + 2 * kLanes);
  const Lanes zero(0.0), one(1.0);
  const Mask used = marker.a + marker.c > zero;
  const Mask before = used & (x_in_cam.z > zero);
  const Lanes point[3] = {Select(before, x_in_cam.x, zero), Select(before, x_in_cam.y, zero),
                          Select(before, x_in_cam.z, one)};
  ProjectWith<kPointDerivatives, kIntrinsicsDerivatives>(view.model, view.intrinsics, point,
                                                         projected);
  const double* const u = slot + 3 * kLanes;
  const Lanes e0 = projected->pixel[0] - Load(u) + dt * Load(u + 2 * kLanes);
  const Lanes e1 = projected->pixel[1] - Load(u + kLanes) + dt * Load(u + 3 * kLanes);
  marker.r0 = marker.a * e0 + marker.b * e1;
  marker.r1 = marker.c * e1;
  const Lanes square = marker.r0 * marker.r0 + marker.r1 * marker.r1;
  // A square that is not a number fails the comparison as well.
  const Mask seen = before & (projected->visible > zero) & (square < Lanes(1e300));
  sum->unseen += Select(used, one, zero) - Select(seen, one, zero);
  marker.weight = AddLoss(input, square, sum);
  return marker;
}

// Rows of the derivative by the point, whitened.
RIGCAL_INLINE void WhitenedRows(const MarkerResidual& marker,
                                const ProjectedPoint<Lanes>& projected, Vec3* row0, Vec3* row1) {
  const auto& d = projected.d_point;
  row0->x = marker.a * d[0][0] + marker.b * d[1][0];
  row0->y = marker.a * d[0][1] + marker.b * d[1][1];
  row0->z = marker.a * d[0][2] + marker.b * d[1][2];
  row1->x = marker.c * d[1][0];
  row1->y = marker.c * d[1][1];
  row1->z = marker.c * d[1][2];
}

// The derivative of the whitened residual by base column `kind`.
template <bool kIntrinsics>
RIGCAL_INLINE void BaseDerivative(int kind, const MarkerResidual& marker, const double* slot,
                                  const Lanes& clock_time, const ProjectedPoint<Lanes>& projected,
                                  Lanes* e0, Lanes* e1) {
  Lanes d0, d1;
  if (!kIntrinsics || kind < KernelColumns::kFirstIntrinsic) {
    d0 = Load(slot + 5 * kLanes), d1 = Load(slot + 6 * kLanes);
    if (kind == KernelColumns::kRate) d0 *= clock_time, d1 *= clock_time;
  } else {
    d0 = projected.d_intrinsics[0][kind - KernelColumns::kFirstIntrinsic];
    d1 = projected.d_intrinsics[1][kind - KernelColumns::kFirstIntrinsic];
  }
  *e0 = marker.a * d0 + marker.b * d1;
  *e1 = marker.c * d1;
}

}  // namespace rigcal::server::RIGCAL_KERNEL
