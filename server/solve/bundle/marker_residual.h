// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/camera/projection.h"

// The residual of one marker, r = L (p - (u - dt u')) of bundle_problem.h, and its derivatives,
// written once for every number type T of common/camera/projection.h: plain doubles (MarkerCost),
// eight instants side by side (the line bundle's kernel), dual numbers (the tests' reference).
// P is the type of what a view knows: double, or T to differentiate by it.
//
// An unknown of a camera or clock that moves the image of every marker enters here, in
// ViewEstimate, TimeShift and ViewUnknowns; only its bookkeeping lies elsewhere.
//
// As projection.h, this leaves no code behind for other instruction sets to link.

namespace rigcal::server {

template <typename T>
struct Vec3 {
  T x, y, z;
};
template <typename T>
[[gnu::always_inline]] inline Vec3<T> operator+(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <typename T>
[[gnu::always_inline]] inline Vec3<T> operator*(const T& s, const Vec3<T>& v) {
  return {s * v.x, s * v.y, s * v.z};
}
template <typename T>
[[gnu::always_inline]] inline void operator+=(Vec3<T>& a, const Vec3<T>& b) {
  a = a + b;
}
template <typename T>
[[gnu::always_inline]] inline T Dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <typename T>
[[gnu::always_inline]] inline Vec3<T> Cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
// m v and m^T v for a 3x3 matrix, row by row.
template <typename T, typename P>
[[gnu::always_inline]] inline Vec3<T> Times(const P* m, const Vec3<T>& v) {
  return {T(m[0]) * v.x + T(m[1]) * v.y + T(m[2]) * v.z,
          T(m[3]) * v.x + T(m[4]) * v.y + T(m[5]) * v.z,
          T(m[6]) * v.x + T(m[7]) * v.y + T(m[8]) * v.z};
}
template <typename T, typename P>
[[gnu::always_inline]] inline Vec3<T> TransposedTimes(const P* m, const Vec3<T>& v) {
  return {T(m[0]) * v.x + T(m[3]) * v.y + T(m[6]) * v.z,
          T(m[1]) * v.x + T(m[4]) * v.y + T(m[7]) * v.z,
          T(m[2]) * v.x + T(m[5]) * v.y + T(m[8]) * v.z};
}

// A view, a camera under one clock, at the present estimates. rotation: row by row, cam_from_rig.
template <typename P>
struct ViewEstimate {
  DistortionModel model = DistortionModel::kBrownConrady;
  P rotation[9] = {};
  P translation[3] = {};
  P intrinsics[kMaxIntrinsics] = {};
  P offset_s = P(0.0);
  P rate = P(0.0);
  P line_delay_s = P(0.0);  // of the camera, from one image row to the next
  P middle_row = P(0.0);    // whose time is that of the clock
};

// The unknowns of a view besides its pose, in the order in which solvers number them.
struct ViewUnknowns {
  static constexpr int kOffset = 0, kRate = 1, kLineDelay = 2, kFirstIntrinsic = 3;
  static constexpr int kMaxCount = kFirstIntrinsic + kMaxIntrinsics;
};

// The target's line as a view sees it: marker m is at start + s_m * slope in the camera's frame.
template <typename T>
struct LineInView {
  Vec3<T> start;   // R o + t
  Vec3<T> origin;  // R o
  Vec3<T> slope;   // R d
};
template <typename T, typename P>
[[gnu::always_inline]] inline LineInView<T> SeeLine(const ViewEstimate<P>& view,
                                                    const Vec3<T>& origin,
                                                    const Vec3<T>& direction) {
  LineInView<T> line;
  line.origin = Times(view.rotation, origin);
  line.slope = Times(view.rotation, direction);
  const P* const t = view.translation;
  line.start = line.origin + Vec3<T>{T(t[0]), T(t[1]), T(t[2])};
  return line;
}

// dt, by which the view's clock is still off at `clock_time`.
template <typename T, typename P>
[[gnu::always_inline]] inline T TimeShift(const ViewEstimate<P>& view, const T& clock_time) {
  return T(view.offset_s) + T(view.rate) * clock_time;
}

// The image rows by which a marker is seen later than its camera's middle row.
template <typename T, typename P>
[[gnu::always_inline]] inline T RowsLate(const ViewEstimate<P>& view, const T& row) {
  return row - T(view.middle_row);
}

// The measurement of a marker: its centre u, its image velocity u', and L as [a b; 0 c].
template <typename T>
struct MeasuredMarker {
  T a, b, c;
  T centre[2];
  T velocity[2];

  [[gnu::always_inline]] void Whiten(const T& e0, const T& e1, T* r0, T* r1) const {
    *r0 = a * e0 + b * e1;
    *r1 = c * e1;
  }
};

// The residual given the projected point.
template <typename T>
[[gnu::always_inline]] inline void WhitenedResidual(const MeasuredMarker<T>& measured,
                                                    const ProjectedPoint<T>& projected, const T& dt,
                                                    T* r0, T* r1) {
  const T e0 = projected.pixel[0] - measured.centre[0] + dt * measured.velocity[0];
  const T e1 = projected.pixel[1] - measured.centre[1] + dt * measured.velocity[1];
  measured.Whiten(e0, e1, r0, r1);
}

// d residual / d x_in_cam by rows, from which follow, with x = start + s * slope:
//   rotation (left, of cam_from_rig)  Cross(x - t, row)      translation        row
//   origin of the target              R^T row                direction          s R^T row
//   position of the marker            Dot(row, slope)
template <typename T>
[[gnu::always_inline]] inline void PointDerivative(const MeasuredMarker<T>& measured,
                                                   const ProjectedPoint<T>& projected,
                                                   Vec3<T>* row0, Vec3<T>* row1) {
  const auto& d = projected.d_point;
  measured.Whiten(d[0][0], d[1][0], &row0->x, &row1->x);
  measured.Whiten(d[0][1], d[1][1], &row0->y, &row1->y);
  measured.Whiten(d[0][2], d[1][2], &row0->z, &row1->z);
}

// d residual / d one of ViewUnknowns. kIntrinsics: it may be an intrinsic value.
template <bool kIntrinsics, typename T>
[[gnu::always_inline]] inline void ViewDerivative(int unknown, const MeasuredMarker<T>& measured,
                                                  const ProjectedPoint<T>& projected,
                                                  const T& clock_time, const T& rows_late, T* d0,
                                                  T* d1) {
  if (!kIntrinsics || unknown < ViewUnknowns::kFirstIntrinsic) {
    T v0 = measured.velocity[0], v1 = measured.velocity[1];
    if (unknown == ViewUnknowns::kRate) v0 = v0 * clock_time, v1 = v1 * clock_time;
    if (unknown == ViewUnknowns::kLineDelay) v0 = v0 * rows_late, v1 = v1 * rows_late;
    measured.Whiten(v0, v1, d0, d1);
  } else {
    const int i = unknown - ViewUnknowns::kFirstIntrinsic;
    measured.Whiten(projected.d_intrinsics[0][i], projected.d_intrinsics[1][i], d0, d1);
  }
}

}  // namespace rigcal::server
