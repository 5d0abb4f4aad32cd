// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

// The projections of common/camera/camera_model.h with their derivatives by the point, the focal
// lengths, the centre and the coefficients, for any number type: plain doubles, or eight lanes at
// once. T needs + - * /, a constructor from double, a comparison, and Select(comparison, yes, no),
// Sqrt(T), Atan2(T, T) found by argument-dependent lookup.
//
// Nothing is checked here: with z <= 0, or where the rational model's denominator is not positive,
// the outputs mean nothing. `visible` of the result says so for the latter (<= 0: not visible).

namespace rigcal::server {

enum class KernelModel : uint8_t { kBrownConrady, kRational, kFisheye };
inline constexpr int kMaxIntrinsics = 12;

inline double Select(bool which, double yes, double no) { return which ? yes : no; }
inline double Sqrt(double value) { return std::sqrt(value); }
inline double Atan2(double y, double x) { return std::atan2(y, x); }

template <typename T>
struct ProjectedPoint {
  T pixel[2];
  T d_point[2][3];
  T d_intrinsics[2][kMaxIntrinsics];  // d pixel / d (fx fy cx cy coefficients)
  T visible;                          // positive: yes
};

namespace line_bundle_internal {

template <typename T>
__attribute__((always_inline)) inline void FinishProjection(const double* intrinsics,
                                                            const T& x_distorted,
                                                            const T& y_distorted,
                                                            ProjectedPoint<T>* out) {
  out->pixel[0] = x_distorted * T(intrinsics[0]) + T(intrinsics[2]);
  out->pixel[1] = y_distorted * T(intrinsics[1]) + T(intrinsics[3]);
}

template <typename T>
__attribute__((always_inline)) inline void FinishIntrinsics(const double* intrinsics, int count,
                                                            const T& x_distorted,
                                                            const T& y_distorted,
                                                            ProjectedPoint<T>* out) {
  const T zero(0.0), one(1.0);
  T* const dx = out->d_intrinsics[0];
  T* const dy = out->d_intrinsics[1];
  dx[0] = x_distorted, dx[1] = zero, dx[2] = one, dx[3] = zero;
  dy[0] = zero, dy[1] = y_distorted, dy[2] = zero, dy[3] = one;
  for (int i = 4; i < 4 + count; ++i) {
    dx[i] = dx[i] * T(intrinsics[0]);
    dy[i] = dy[i] * T(intrinsics[1]);
  }
}

}  // namespace line_bundle_internal

// Brown-Conrady (5 coefficients) and rational model (8).
template <bool kRational, bool kPointDerivatives, bool kIntrinsicsDerivatives, typename T>
__attribute__((always_inline)) inline void ProjectPolynomial(const double* intrinsics,
                                                             const T (&x_in_cam)[3],
                                                             ProjectedPoint<T>* out) {
  const double* const k = intrinsics + 4;
  const T inverse_z = T(1.0) / x_in_cam[2];
  const T x = x_in_cam[0] * inverse_z, y = x_in_cam[1] * inverse_z;
  const T r2 = x * x + y * y;
  const T numerator = ((r2 * T(k[4]) + T(k[1])) * r2 + T(k[0])) * r2 + T(1.0);
  T inverse(1.0);
  out->visible = T(1.0);
  if constexpr (kRational) {
    out->visible = ((r2 * T(k[7]) + T(k[6])) * r2 + T(k[5])) * r2 + T(1.0);
    inverse = T(1.0) / out->visible;
  }
  const T radial = kRational ? numerator * inverse : numerator;
  const T p1(k[2]), p2(k[3]);
  const T xy2 = T(2.0) * x * y, r2_2x2 = r2 + T(2.0) * x * x, r2_2y2 = r2 + T(2.0) * y * y;
  const T x_distorted = x * radial + p1 * xy2 + p2 * r2_2x2;
  const T y_distorted = y * radial + p1 * r2_2y2 + p2 * xy2;
  line_bundle_internal::FinishProjection(intrinsics, x_distorted, y_distorted, out);
  if constexpr (kPointDerivatives) {
    T slope = (r2 * T(3 * k[4]) + T(2 * k[1])) * r2 + T(k[0]);  // d radial / d r2
    if constexpr (kRational) {
      const T pole_slope = (r2 * T(3 * k[7]) + T(2 * k[6])) * r2 + T(k[5]);
      slope = (slope - radial * pole_slope) * inverse;
    }
    const T p1x = p1 * x, p1y = p1 * y, p2x = p2 * x, p2y = p2 * y;
    const T dxx = radial + T(2.0) * x * x * slope + T(2.0) * p1y + T(6.0) * p2x;
    const T dxy = xy2 * slope + T(2.0) * (p1x + p2y);
    const T dyy = radial + T(2.0) * y * y * slope + T(6.0) * p1y + T(2.0) * p2x;
    const T fx = T(intrinsics[0]) * inverse_z, fy = T(intrinsics[1]) * inverse_z;
    out->d_point[0][0] = fx * dxx;
    out->d_point[0][1] = fx * dxy;
    out->d_point[0][2] = fx * (T(0.0) - dxx * x - dxy * y);
    out->d_point[1][0] = fy * dxy;
    out->d_point[1][1] = fy * dyy;
    out->d_point[1][2] = fy * (T(0.0) - dxy * x - dyy * y);
  }
  if constexpr (kIntrinsicsDerivatives) {
    const T r4 = r2 * r2, r6 = r4 * r2;
    const T x_pole = x * inverse, y_pole = y * inverse;
    T* const dx = out->d_intrinsics[0];
    T* const dy = out->d_intrinsics[1];
    dx[4] = x_pole * r2, dx[5] = x_pole * r4, dx[6] = xy2, dx[7] = r2_2x2, dx[8] = x_pole * r6;
    dy[4] = y_pole * r2, dy[5] = y_pole * r4, dy[6] = r2_2y2, dy[7] = xy2, dy[8] = y_pole * r6;
    if constexpr (kRational) {
      const T x_radial = T(0.0) - x_pole * radial, y_radial = T(0.0) - y_pole * radial;
      dx[9] = x_radial * r2, dx[10] = x_radial * r4, dx[11] = x_radial * r6;
      dy[9] = y_radial * r2, dy[10] = y_radial * r4, dy[11] = y_radial * r6;
    }
    line_bundle_internal::FinishIntrinsics(intrinsics, kRational ? 8 : 5, x_distorted, y_distorted,
                                           out);
  }
}

// Equidistant (4 coefficients): bends the angle to the axis, not normalised coordinates.
template <bool kPointDerivatives, bool kIntrinsicsDerivatives, typename T>
__attribute__((always_inline)) inline void ProjectFisheye(const double* intrinsics,
                                                          const T (&x_in_cam)[3],
                                                          ProjectedPoint<T>* out) {
  const double* const k = intrinsics + 4;
  const T x = x_in_cam[0], y = x_in_cam[1], z = x_in_cam[2];
  const T rho2 = x * x + y * y;
  const auto on_axis = rho2 < z * z * T(1e-16);  // there theta / rho is 1 / z to the last digit
  const T safe_rho2 = Select(on_axis, T(1.0), rho2);
  const T rho = Sqrt(safe_rho2);
  const T theta = Select(on_axis, T(0.0), Atan2(rho, z));
  const T t2 = theta * theta;
  const T bent = theta * ((((t2 * T(k[3]) + T(k[2])) * t2 + T(k[1])) * t2 + T(k[0])) * t2 + T(1.0));
  const T gain = Select(on_axis, T(1.0) / z, bent / rho);
  const T x_distorted = x * gain, y_distorted = y * gain;
  out->visible = T(1.0);
  line_bundle_internal::FinishProjection(intrinsics, x_distorted, y_distorted, out);
  if constexpr (kPointDerivatives) {
    const T slope =
        (((t2 * T(9 * k[3]) + T(7 * k[2])) * t2 + T(5 * k[1])) * t2 + T(3 * k[0])) * t2 + T(1.0);
    const T slope_per_distance2 = slope / (rho2 + z * z);
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
    line_bundle_internal::FinishIntrinsics(intrinsics, 4, x_distorted, y_distorted, out);
  }
}

template <bool kPointDerivatives, bool kIntrinsicsDerivatives, typename T>
__attribute__((always_inline)) inline void ProjectWith(KernelModel model, const double* intrinsics,
                                                       const T (&x_in_cam)[3],
                                                       ProjectedPoint<T>* out) {
  if (model == KernelModel::kFisheye) {
    ProjectFisheye<kPointDerivatives, kIntrinsicsDerivatives>(intrinsics, x_in_cam, out);
  } else if (model == KernelModel::kRational) {
    ProjectPolynomial<true, kPointDerivatives, kIntrinsicsDerivatives>(intrinsics, x_in_cam, out);
  } else {
    ProjectPolynomial<false, kPointDerivatives, kIntrinsicsDerivatives>(intrinsics, x_in_cam, out);
  }
}

}  // namespace rigcal::server
