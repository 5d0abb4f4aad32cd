// SPDX-License-Identifier: Apache-2.0
#include "common/camera/camera_model.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "absl/strings/str_cat.h"

namespace rigcal {
namespace {

constexpr double kNoDistortion[8] = {};
constexpr double kRoundTripTolerance = 1e-9;  // normalised coordinates
constexpr double kExact = 1e-14;              // likewise: what rounding leaves
constexpr int kMaxNewtonSteps = 100;
constexpr int kMaxHalvings = 40;
constexpr int kMonotonicitySamples = 32;
constexpr double kMaxTheta = 1.5707;  // of a fisheye; tan() of more is no useful direction

// Null where the number of coefficients is not the model's.
const double* Coefficients(const Intrinsics& intrinsics) {
  if (intrinsics.distortion.empty()) return kNoDistortion;
  const size_t count = static_cast<size_t>(CoefficientCount(intrinsics.model));
  return intrinsics.distortion.size() == count ? intrinsics.distortion.data() : nullptr;
}

using Distorted = PolynomialDistortion<double>;

// False at or beyond a pole of the rational model.
bool Distort(const double* k, bool rational, double x, double y, Distorted* out) {
  if (rational) {
    DistortPolynomial<true, true>(k, x, y, out);
  } else {
    DistortPolynomial<false, true>(k, x, y, out);
  }
  return out->pole > 0;
}

double DistortedTheta(const double* k, double theta, double* slope) {
  const double t2 = theta * theta;
  *slope = DistortThetaSlope(k, t2);
  return DistortTheta(k, theta, t2);
}

template <bool kPointDerivatives, bool kIntrinsicsDerivatives>
bool ProjectIfVisible(DistortionModel model, const double* intrinsics,
                      const Eigen::Vector3d& x_in_cam, ProjectedPoint<double>* projected) {
  if (!(x_in_cam.z() > 0)) return false;
  const double point[3] = {x_in_cam.x(), x_in_cam.y(), x_in_cam.z()};
  ProjectPoint<kPointDerivatives, kIntrinsicsDerivatives>(model, intrinsics, point, projected);
  if (!(projected->visible > 0)) return false;
  if constexpr (kPointDerivatives) {
    for (const auto& row : projected->d_point) {
      for (const double value : row) {
        if (!std::isfinite(value)) return false;
      }
    }
  }
  return std::isfinite(projected->pixel[0]) && std::isfinite(projected->pixel[1]);
}

bool IsPositiveDefinite(const Distorted& d) {
  return d.dx_dx > 0 && d.dx_dx * d.dy_dy - d.dx_dy * d.dx_dy > 0;
}

// With a positive definite derivative everywhere on a convex region the map is one to one there;
// the region that counts is the one that holds the image's centre.
bool MonotoneUpTo(const double* k, bool rational, const Eigen::Vector2d& point) {
  Distorted d;
  for (int i = 1; i <= kMonotonicitySamples; ++i) {
    const double t = static_cast<double>(i) / kMonotonicitySamples;
    if (!Distort(k, rational, t * point.x(), t * point.y(), &d)) return false;
    if (!IsPositiveDefinite(d)) return false;
  }
  return true;
}

// Newton's method from the centre, held inside the region where the derivative is positive definite
// and the error falls. False where it does not arrive.
bool UndistortPolynomial(const double* k, bool rational, const Eigen::Vector2d& distorted,
                         Eigen::Vector2d* point) {
  Eigen::Vector2d x = Eigen::Vector2d::Zero();
  Distorted d;
  if (!Distort(k, rational, 0, 0, &d)) return false;
  double error = distorted.norm();
  for (int step = 0; step < kMaxNewtonSteps && error > kExact; ++step) {
    const Eigen::Vector2d residual = distorted - Eigen::Vector2d(d.x, d.y);
    const double determinant = d.dx_dx * d.dy_dy - d.dx_dy * d.dx_dy;
    Eigen::Vector2d delta(d.dy_dy * residual.x() - d.dx_dy * residual.y(),
                          d.dx_dx * residual.y() - d.dx_dy * residual.x());
    delta /= determinant;
    bool better = false;
    for (int halving = 0; halving < kMaxHalvings && !better; ++halving, delta *= 0.5) {
      const Eigen::Vector2d next = x + delta;
      Distorted at_next;
      if (!Distort(k, rational, next.x(), next.y(), &at_next)) continue;
      const double next_error = (distorted - Eigen::Vector2d(at_next.x, at_next.y)).norm();
      if (!(next_error < error) || !IsPositiveDefinite(at_next)) continue;
      x = next;
      d = at_next;
      error = next_error;
      better = true;
    }
    if (!better) break;
  }
  *point = x;
  return error <= kRoundTripTolerance && MonotoneUpTo(k, rational, x);
}

bool UndistortFisheye(const double* k, const Eigen::Vector2d& distorted, Eigen::Vector2d* point) {
  const double goal = distorted.norm();
  double theta = 0;
  double slope = 1;
  double value = 0;
  for (int step = 0; step < kMaxNewtonSteps && value != goal; ++step) {
    double delta = (goal - value) / slope;
    bool better = false;
    for (int halving = 0; halving < kMaxHalvings && !better; ++halving, delta *= 0.5) {
      const double next = theta + delta;
      double next_slope = 0;
      const double next_value = DistortedTheta(k, next, &next_slope);
      if (next < 0 || next > kMaxTheta || !(next_slope > 0)) continue;
      if (!(std::abs(goal - next_value) < std::abs(goal - value))) continue;
      theta = next;
      value = next_value;
      slope = next_slope;
      better = true;
    }
    if (!better) break;
  }
  if (!(std::abs(goal - value) <= kRoundTripTolerance)) return false;
  for (int i = 1; i <= kMonotonicitySamples; ++i) {
    DistortedTheta(k, theta * i / kMonotonicitySamples, &slope);
    if (!(slope > 0)) return false;
  }
  *point = goal > 1e-12 ? Eigen::Vector2d(distorted * (std::tan(theta) / goal)) : distorted;
  return true;
}

}  // namespace

bool Project(DistortionModel model, const double* intrinsics, const Eigen::Vector3d& x_in_cam,
             Eigen::Vector2d* pixel, Eigen::Matrix<double, 2, 3>* d_pixel_d_point,
             IntrinsicsJacobian* d_pixel_d_intrinsics) {
  ProjectedPoint<double> projected;
  const bool visible =
      d_pixel_d_intrinsics != nullptr
          ? ProjectIfVisible<true, true>(model, intrinsics, x_in_cam, &projected)
          : (d_pixel_d_point != nullptr
                 ? ProjectIfVisible<true, false>(model, intrinsics, x_in_cam, &projected)
                 : ProjectIfVisible<false, false>(model, intrinsics, x_in_cam, &projected));
  if (!visible) return false;
  *pixel = {projected.pixel[0], projected.pixel[1]};
  if (d_pixel_d_point != nullptr) {
    *d_pixel_d_point =
        Eigen::Map<const Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>(projected.d_point[0]);
  }
  if (d_pixel_d_intrinsics != nullptr) {
    *d_pixel_d_intrinsics =
        Eigen::Map<const Eigen::Matrix<double, 2, kMaxIntrinsics, Eigen::RowMajor>>(
            projected.d_intrinsics[0])
            .leftCols(IntrinsicsSize(model));
  }
  return true;
}

bool Project(const Intrinsics& intrinsics, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* pixel,
             Eigen::Matrix<double, 2, 3>* d_pixel_d_point) {
  const double* const k = Coefficients(intrinsics);
  if (k == nullptr) return false;
  double values[kMaxIntrinsics] = {intrinsics.fx_px, intrinsics.fy_px, intrinsics.cx_px,
                                   intrinsics.cy_px};
  std::copy_n(k, CoefficientCount(intrinsics.model), values + 4);
  return Project(intrinsics.model, values, x_in_cam, pixel, d_pixel_d_point, nullptr);
}

absl::StatusOr<Eigen::Vector2d> Undistort(const Intrinsics& intrinsics,
                                          const Eigen::Vector2d& pixel) {
  const double* k = Coefficients(intrinsics);
  const Eigen::Vector2d distorted((pixel.x() - intrinsics.cx_px) / intrinsics.fx_px,
                                  (pixel.y() - intrinsics.cy_px) / intrinsics.fy_px);
  Eigen::Vector2d point;
  const bool found = k != nullptr && distorted.allFinite() &&
                     (intrinsics.model == DistortionModel::kFisheye
                          ? UndistortFisheye(k, distorted, &point)
                          : UndistortPolynomial(k, intrinsics.model == DistortionModel::kRational,
                                                distorted, &point));
  if (!found || !point.allFinite()) {
    return absl::OutOfRangeError(
        absl::StrCat("pixel (", pixel.x(), ", ", pixel.y(),
                     ") is outside the part of the image in which the lens distortion (",
                     std::string(DistortionModelName(intrinsics.model)), ") has an inverse"));
  }
  return point;
}

}  // namespace rigcal
