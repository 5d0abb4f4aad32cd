// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>

#include "server/solve/bundle/bundle_problem.h"

// The residuals of bundle_problem.h written for automatic differentiation.

namespace rigcal::testing {

using server::BundleMarker;

template <typename T>
void DistortRadially(const T* k, bool rational, const T& x, const T& y, T* out) {
  const T r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
  T radial = T(1) + k[0] * r2 + k[1] * r4 + k[4] * r6;
  if (rational) radial /= T(1) + k[5] * r2 + k[6] * r4 + k[7] * r6;
  out[0] = x * radial + T(2) * k[2] * x * y + k[3] * (r2 + T(2) * x * x);
  out[1] = y * radial + k[2] * (r2 + T(2) * y * y) + T(2) * k[3] * x * y;
}

template <typename T>
void DistortFisheye(const T* k, const T& x, const T& y, T* out) {
  using std::atan;
  using std::sqrt;
  const T r2 = x * x + y * y;
  if (r2 < T(1e-20)) {
    out[0] = x, out[1] = y;
    return;
  }
  const T r = sqrt(r2), theta = atan(r), t2 = theta * theta, t4 = t2 * t2;
  const T bent = theta * (T(1) + k[0] * t2 + k[1] * t4 + k[2] * t4 * t2 + k[3] * t4 * t4);
  out[0] = x * bent / r, out[1] = y * bent / r;
}

struct MarkerResidual {
  DistortionModel model;
  BundleMarker marker;
  double clock_time_s;

  template <typename T>
  bool Evaluate(const T* rotation, const T* translation, const T* intrinsics, const T& offset,
                const T& rate, const T& position, const T* target, T* residuals) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(rotation);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(translation), origin(target),
        direction(target + 3);
    const Eigen::Matrix<T, 3, 1> x_in_cam = q * (origin + position * direction) + t;
    if (!(x_in_cam.z() > T(0))) return false;
    const T x = x_in_cam.x() / x_in_cam.z(), y = x_in_cam.y() / x_in_cam.z();
    T distorted[2];
    if (model == DistortionModel::kFisheye) {
      DistortFisheye(intrinsics + 4, x, y, distorted);
    } else {
      DistortRadially(intrinsics + 4, model == DistortionModel::kRational, x, y, distorted);
    }
    const T dt = offset + rate * T(clock_time_s);
    const T e0 = intrinsics[0] * distorted[0] + intrinsics[2] - T(marker.centre_px.x()) +
                 dt * T(marker.velocity_px_s.x());
    const T e1 = intrinsics[1] * distorted[1] + intrinsics[3] - T(marker.centre_px.y()) +
                 dt * T(marker.velocity_px_s.y());
    const Eigen::Matrix2d& root = marker.sqrt_information;
    residuals[0] = T(root(0, 0)) * e0 + T(root(0, 1)) * e1;
    residuals[1] = T(root(1, 0)) * e0 + T(root(1, 1)) * e1;
    return true;
  }
};

struct FreeIntrinsicsCost : MarkerResidual {
  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* intrinsics, const T* offset,
                  const T* rate, const T* position, const T* target, T* residuals) const {
    return Evaluate(rotation, translation, intrinsics, *offset, *rate, *position, target,
                    residuals);
  }
};

struct FixedIntrinsicsCost : MarkerResidual {
  std::array<double, 12> values;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* offset, const T* rate,
                  const T* position, const T* target, T* residuals) const {
    T intrinsics[12];
    for (size_t i = 0; i < values.size(); ++i) intrinsics[i] = T(values[i]);
    return Evaluate(rotation, translation, intrinsics, *offset, *rate, *position, target,
                    residuals);
  }
};

// (plus - minus - mean) / sigma
struct DifferencePrior {
  double mean, sigma;
  template <typename T>
  bool operator()(const T* minus, const T* plus, T* residual) const {
    *residual = (*plus - *minus - T(mean)) / T(sigma);
    return true;
  }
};
struct ScalarPrior {
  double mean, sigma;
  int component;
  template <typename T>
  bool operator()(const T* value, T* residual) const {
    *residual = (value[component] - T(mean)) / T(sigma);
    return true;
  }
};

}  // namespace rigcal::testing
