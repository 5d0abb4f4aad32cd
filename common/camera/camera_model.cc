// SPDX-License-Identifier: Apache-2.0
#include "common/camera/camera_model.h"

#include <Eigen/LU>
#include <cmath>
#include <cstddef>

#include "absl/strings/str_cat.h"

namespace rigcal {
namespace {

constexpr double kNoDistortion[8] = {};
constexpr double kRoundTripTolerance = 1e-9;  // normalised coordinates
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

// Distorted coordinates of a normalised point, and their derivative, which is symmetric.
struct Distorted {
  double x, y;
  double dx_dx, dx_dy, dy_dy;
};

// Brown-Conrady (`rational` false) and rational model. False at or beyond a pole.
inline bool DistortPolynomial(const double* k, bool rational, double x, double y, Distorted* out) {
  const double r2 = x * x + y * y;
  double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  double radial_slope = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);  // d radial / d r2
  if (rational) {
    const double pole = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    const double pole_slope = k[5] + r2 * (2 * k[6] + r2 * 3 * k[7]);
    if (!(pole > 0)) return false;
    radial /= pole;
    radial_slope = (radial_slope - radial * pole_slope) / pole;
  }
  const double p1 = k[2], p2 = k[3];
  out->x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
  out->y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
  out->dx_dx = radial + 2 * x * x * radial_slope + 2 * p1 * y + 6 * p2 * x;
  out->dx_dy = 2 * x * y * radial_slope + 2 * p1 * x + 2 * p2 * y;
  out->dy_dy = radial + 2 * y * y * radial_slope + 6 * p1 * y + 2 * p2 * x;
  return true;
}

inline double DistortedTheta(const double* k, double theta, double* slope) {
  const double t2 = theta * theta;
  *slope = 1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])));
  return theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

// Distorted coordinates of a point before the camera and their derivative by the point (2x3).
bool DistortPoint(const Intrinsics& intrinsics, const double* k, const Eigen::Vector3d& point,
                  Eigen::Vector2d* distorted, Eigen::Matrix<double, 2, 3>* jacobian) {
  const double inverse_z = 1 / point.z();
  const double x = point.x() * inverse_z, y = point.y() * inverse_z;
  Distorted d;
  if (!DistortPolynomial(k, intrinsics.model == DistortionModel::kRational, x, y, &d)) return false;
  *distorted = {d.x, d.y};
  if (jacobian != nullptr) {
    *jacobian << d.dx_dx * inverse_z, d.dx_dy * inverse_z,
        -(d.dx_dx * x + d.dx_dy * y) * inverse_z,  //
        d.dx_dy * inverse_z, d.dy_dy * inverse_z, -(d.dx_dy * x + d.dy_dy * y) * inverse_z;
  }
  return true;
}

void DistortFisheyePoint(const double* k, const Eigen::Vector3d& point, Eigen::Vector2d* distorted,
                         Eigen::Matrix<double, 2, 3>* jacobian) {
  const double x = point.x(), y = point.y(), z = point.z();
  const double rho2 = x * x + y * y;
  const double rho = std::sqrt(rho2);
  // Near the axis theta / rho is 1 / z to the last digit, and the exact form divides 0 by 0.
  const bool on_axis = rho < 1e-8 * z;
  double slope = 1;
  const double theta_distorted = on_axis ? rho / z : DistortedTheta(k, std::atan2(rho, z), &slope);
  const double gain = on_axis ? 1 / z : theta_distorted / rho;
  *distorted = {x * gain, y * gain};
  if (jacobian == nullptr) return;
  const double distance2 = rho2 + z * z;
  const double bend = on_axis ? 0 : (slope * z / distance2 - gain) / rho2;
  *jacobian << gain + x * x * bend, x * y * bend, -x * slope / distance2,  //
      x * y * bend, gain + y * y * bend, -y * slope / distance2;
}

bool ProjectImpl(const Intrinsics& intrinsics, const Eigen::Vector3d& x_in_cam,
                 Eigen::Vector2d* pixel, Eigen::Matrix<double, 2, 3>* jacobian) {
  if (!(x_in_cam.z() > 0)) return false;
  const double* k = Coefficients(intrinsics);
  if (k == nullptr) return false;
  Eigen::Vector2d distorted;
  if (intrinsics.model == DistortionModel::kFisheye) {
    DistortFisheyePoint(k, x_in_cam, &distorted, jacobian);
  } else if (!DistortPoint(intrinsics, k, x_in_cam, &distorted, jacobian)) {
    return false;
  }
  const Eigen::Vector2d result(intrinsics.fx_px * distorted.x() + intrinsics.cx_px,
                               intrinsics.fy_px * distorted.y() + intrinsics.cy_px);
  if (!std::isfinite(result.x()) || !std::isfinite(result.y())) return false;
  if (jacobian != nullptr) {
    jacobian->row(0) *= intrinsics.fx_px;
    jacobian->row(1) *= intrinsics.fy_px;
    if (!jacobian->allFinite()) return false;
  }
  *pixel = result;
  return true;
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
    if (!DistortPolynomial(k, rational, t * point.x(), t * point.y(), &d)) return false;
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
  if (!DistortPolynomial(k, rational, 0, 0, &d)) return false;
  double error = distorted.norm();
  for (int step = 0; step < kMaxNewtonSteps && error > 0; ++step) {
    const Eigen::Vector2d residual = distorted - Eigen::Vector2d(d.x, d.y);
    const double determinant = d.dx_dx * d.dy_dy - d.dx_dy * d.dx_dy;
    Eigen::Vector2d delta(d.dy_dy * residual.x() - d.dx_dy * residual.y(),
                          d.dx_dx * residual.y() - d.dx_dy * residual.x());
    delta /= determinant;
    bool better = false;
    for (int halving = 0; halving < kMaxHalvings && !better; ++halving, delta *= 0.5) {
      const Eigen::Vector2d next = x + delta;
      Distorted at_next;
      if (!DistortPolynomial(k, rational, next.x(), next.y(), &at_next)) continue;
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

bool Project(const Intrinsics& intrinsics, const Eigen::Vector3d& x_in_cam,
             Eigen::Vector2d* pixel) {
  return ProjectImpl(intrinsics, x_in_cam, pixel, nullptr);
}

bool Project(const Intrinsics& intrinsics, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* pixel,
             Eigen::Matrix<double, 2, 3>* d_pixel_d_point) {
  return ProjectImpl(intrinsics, x_in_cam, pixel, d_pixel_d_point);
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
