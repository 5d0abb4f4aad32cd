// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "common/camera/distortion_model.h"

// The camera models, written once for every number type: double, several doubles side by side, or
// a dual number of automatic differentiation. Pixels, and on request their derivatives by the
// point in the camera's frame and by the intrinsics.
//
// T, the type of the point, needs + - * / and <, a constructor from double and from I, the type of
// the intrinsics: double, or T to differentiate by them. A type with several values at once
// supplies its own Select(comparison, yes, no), Sqrt and Atan2, found by argument-dependent lookup.
//
// Nothing is checked here: with z <= 0, or where `visible` of the result is not positive, the
// outputs mean nothing. camera_model.h has the checked functions. Everything is inlined and this
// header includes no more than it needs, so that a source compiled for one instruction set leaves
// no code behind for others to link.

namespace rigcal {

inline constexpr int kMaxIntrinsics = 12;  // fx fy cx cy and up to 8 coefficients

namespace projection_internal {

template <typename T>
[[gnu::always_inline]] inline T Select(bool which, const T& yes, const T& no) {
  return which ? yes : no;
}
template <typename T>
[[gnu::always_inline]] inline T Sqrt(const T& value) {
  using std::sqrt;
  return sqrt(value);
}
template <typename T>
[[gnu::always_inline]] inline T Atan2(const T& y, const T& x) {
  using std::atan2;
  return atan2(y, x);
}

}  // namespace projection_internal

template <typename T>
struct ProjectedPoint {
  T pixel[2];
  T d_point[2][3];                    // d pixel / d x_in_cam
  T d_intrinsics[2][kMaxIntrinsics];  // d pixel / d (fx fy cx cy coefficients)
  T visible;                          // positive: yes
};

// Normalised image coordinates after distortion, and what their derivatives are made of.
template <typename T>
struct PolynomialDistortion {
  T x, y;
  T dx_dx, dx_dy, dy_dy;  // by the undistorted coordinates; symmetric
  T pole;                 // the rational model's denominator, 1 for Brown-Conrady

  T r2, xy2, r2_2x2, r2_2y2, inverse_pole, radial;  // r^2, 2xy, r^2 + 2x^2, r^2 + 2y^2, ...
};

// Brown-Conrady (5 coefficients) and rational model (8): OpenCV, calib3d, "projectPoints".
template <bool kRational, bool kDerivatives, typename T, typename I>
[[gnu::always_inline]] inline void DistortPolynomial(const I* k, const T& x, const T& y,
                                                     PolynomialDistortion<T>* out) {
  const T r2 = x * x + y * y;
  const T numerator = ((r2 * T(k[4]) + T(k[1])) * r2 + T(k[0])) * r2 + T(1.0);
  T inverse(1.0);
  out->pole = T(1.0);
  if constexpr (kRational) {
    out->pole = ((r2 * T(k[7]) + T(k[6])) * r2 + T(k[5])) * r2 + T(1.0);
    inverse = T(1.0) / out->pole;
  }
  const T radial = kRational ? numerator * inverse : numerator;
  const T p1(k[2]), p2(k[3]);
  const T xy2 = T(2.0) * x * y, r2_2x2 = r2 + T(2.0) * x * x, r2_2y2 = r2 + T(2.0) * y * y;
  out->x = x * radial + p1 * xy2 + p2 * r2_2x2;
  out->y = y * radial + p1 * r2_2y2 + p2 * xy2;
  out->r2 = r2, out->xy2 = xy2, out->r2_2x2 = r2_2x2, out->r2_2y2 = r2_2y2;
  out->inverse_pole = inverse, out->radial = radial;
  if constexpr (kDerivatives) {
    T slope = (r2 * T(3.0 * k[4]) + T(2.0 * k[1])) * r2 + T(k[0]);  // d radial / d r2
    if constexpr (kRational) {
      const T pole_slope = (r2 * T(3.0 * k[7]) + T(2.0 * k[6])) * r2 + T(k[5]);
      slope = (slope - radial * pole_slope) * inverse;
    }
    const T p1x = p1 * x, p1y = p1 * y, p2x = p2 * x, p2y = p2 * y;
    out->dx_dx = radial + T(2.0) * x * x * slope + T(2.0) * p1y + T(6.0) * p2x;
    out->dx_dy = xy2 * slope + T(2.0) * (p1x + p2y);
    out->dy_dy = radial + T(2.0) * y * y * slope + T(6.0) * p1y + T(2.0) * p2x;
  }
}

// The equidistant model's angle to the axis after distortion, given the angle and its square, and
// the derivative of the one by the other (OpenCV, fisheye module; Kannala and Brandt 2006).
template <typename T, typename I>
[[gnu::always_inline]] inline T DistortTheta(const I* k, const T& theta, const T& t2) {
  return theta * ((((t2 * T(k[3]) + T(k[2])) * t2 + T(k[1])) * t2 + T(k[0])) * t2 + T(1.0));
}
template <typename T, typename I>
[[gnu::always_inline]] inline T DistortThetaSlope(const I* k, const T& t2) {
  return (((t2 * T(9.0 * k[3]) + T(7.0 * k[2])) * t2 + T(5.0 * k[1])) * t2 + T(3.0 * k[0])) * t2 +
         T(1.0);
}

namespace projection_internal {

template <typename T, typename I>
[[gnu::always_inline]] inline void ToPixel(const I* intrinsics, const T& x_distorted,
                                           const T& y_distorted, ProjectedPoint<T>* out) {
  out->pixel[0] = x_distorted * T(intrinsics[0]) + T(intrinsics[2]);
  out->pixel[1] = y_distorted * T(intrinsics[1]) + T(intrinsics[3]);
}

// Scales the coefficients' derivatives to pixels and adds those of fx fy cx cy.
template <typename T, typename I>
[[gnu::always_inline]] inline void FinishIntrinsics(const I* intrinsics, int coefficients,
                                                    const T& x_distorted, const T& y_distorted,
                                                    ProjectedPoint<T>* out) {
  const T zero(0.0), one(1.0);
  T* const dx = out->d_intrinsics[0];
  T* const dy = out->d_intrinsics[1];
  dx[0] = x_distorted, dx[1] = zero, dx[2] = one, dx[3] = zero;
  dy[0] = zero, dy[1] = y_distorted, dy[2] = zero, dy[3] = one;
  for (int i = 4; i < 4 + coefficients; ++i) {
    dx[i] = dx[i] * T(intrinsics[0]);
    dy[i] = dy[i] * T(intrinsics[1]);
  }
}

template <bool kRational, bool kPointDerivatives, bool kIntrinsicsDerivatives, typename T,
          typename I>
[[gnu::always_inline]] inline void ProjectPolynomial(const I* intrinsics, const T (&x_in_cam)[3],
                                                     ProjectedPoint<T>* out) {
  const T inverse_z = T(1.0) / x_in_cam[2];
  const T x = x_in_cam[0] * inverse_z, y = x_in_cam[1] * inverse_z;
  PolynomialDistortion<T> d;
  DistortPolynomial<kRational, kPointDerivatives>(intrinsics + 4, x, y, &d);
  out->visible = d.pole;
  ToPixel(intrinsics, d.x, d.y, out);
  if constexpr (kPointDerivatives) {
    const T fx = T(intrinsics[0]) * inverse_z, fy = T(intrinsics[1]) * inverse_z;
    out->d_point[0][0] = fx * d.dx_dx;
    out->d_point[0][1] = fx * d.dx_dy;
    out->d_point[0][2] = fx * (T(0.0) - d.dx_dx * x - d.dx_dy * y);
    out->d_point[1][0] = fy * d.dx_dy;
    out->d_point[1][1] = fy * d.dy_dy;
    out->d_point[1][2] = fy * (T(0.0) - d.dx_dy * x - d.dy_dy * y);
  }
  if constexpr (kIntrinsicsDerivatives) {
    const T r2 = d.r2, r4 = r2 * r2, r6 = r4 * r2;
    const T x_pole = x * d.inverse_pole, y_pole = y * d.inverse_pole;
    T* const dx = out->d_intrinsics[0];
    T* const dy = out->d_intrinsics[1];
    dx[4] = x_pole * r2, dx[5] = x_pole * r4, dx[6] = d.xy2, dx[7] = d.r2_2x2, dx[8] = x_pole * r6;
    dy[4] = y_pole * r2, dy[5] = y_pole * r4, dy[6] = d.r2_2y2, dy[7] = d.xy2, dy[8] = y_pole * r6;
    if constexpr (kRational) {
      const T x_radial = T(0.0) - x_pole * d.radial, y_radial = T(0.0) - y_pole * d.radial;
      dx[9] = x_radial * r2, dx[10] = x_radial * r4, dx[11] = x_radial * r6;
      dy[9] = y_radial * r2, dy[10] = y_radial * r4, dy[11] = y_radial * r6;
    }
    FinishIntrinsics(intrinsics, kRational ? 8 : 5, d.x, d.y, out);
  }
}

// Bends the angle to the axis, not normalised coordinates.
template <bool kPointDerivatives, bool kIntrinsicsDerivatives, typename T, typename I>
[[gnu::always_inline]] inline void ProjectFisheye(const I* intrinsics, const T (&x_in_cam)[3],
                                                  ProjectedPoint<T>* out) {
  const I* const k = intrinsics + 4;
  const T x = x_in_cam[0], y = x_in_cam[1], z = x_in_cam[2];
  const T rho2 = x * x + y * y;
  const auto on_axis = rho2 < z * z * T(1e-16);  // there theta / rho is 1 / z to the last digit
  const T safe_rho2 = Select(on_axis, T(1.0), rho2);
  const T rho = Sqrt(safe_rho2);
  const T theta = Select(on_axis, T(0.0), Atan2(rho, z));
  const T t2 = theta * theta;
  const T bent = DistortTheta(k, theta, t2);
  const T gain = Select(on_axis, T(1.0) / z, bent / rho);
  const T x_distorted = x * gain, y_distorted = y * gain;
  out->visible = T(1.0);
  ToPixel(intrinsics, x_distorted, y_distorted, out);
  if constexpr (kPointDerivatives) {
    const T slope_per_distance2 = DistortThetaSlope(k, t2) / (rho2 + z * z);
    const T bend = Select(on_axis, T(0.0), (slope_per_distance2 * z - gain) / safe_rho2);
    const T fx(intrinsics[0]), fy(intrinsics[1]);
    out->d_point[0][0] = fx * (gain + x * x * bend);
    out->d_point[0][1] = fx * (x * y * bend);
    out->d_point[0][2] = fx * (T(0.0) - x * slope_per_distance2);
    out->d_point[1][0] = fy * (x * y * bend);
    out->d_point[1][1] = fy * (gain + y * y * bend);
    out->d_point[1][2] = fy * (T(0.0) - y * slope_per_distance2);
  }
  if constexpr (kIntrinsicsDerivatives) {
    const T x_unit = Select(on_axis, T(0.0), x / rho), y_unit = Select(on_axis, T(0.0), y / rho);
    T power = theta;
    for (int i = 4; i < 8; ++i) {
      power = power * t2;
      out->d_intrinsics[0][i] = x_unit * power;
      out->d_intrinsics[1][i] = y_unit * power;
    }
    FinishIntrinsics(intrinsics, 4, x_distorted, y_distorted, out);
  }
}

}  // namespace projection_internal

// `intrinsics`: fx fy cx cy, then the coefficients of `model`. What is not asked for is not
// written.
template <bool kPointDerivatives, bool kIntrinsicsDerivatives, typename T, typename I>
[[gnu::always_inline]] inline void ProjectPoint(DistortionModel model, const I* intrinsics,
                                                const T (&x_in_cam)[3], ProjectedPoint<T>* out) {
  using namespace projection_internal;
  if (model == DistortionModel::kFisheye) {
    ProjectFisheye<kPointDerivatives, kIntrinsicsDerivatives>(intrinsics, x_in_cam, out);
  } else if (model == DistortionModel::kRational) {
    ProjectPolynomial<true, kPointDerivatives, kIntrinsicsDerivatives>(intrinsics, x_in_cam, out);
  } else {
    ProjectPolynomial<false, kPointDerivatives, kIntrinsicsDerivatives>(intrinsics, x_in_cam, out);
  }
}

}  // namespace rigcal
