// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/projection_jacobian.h"

#include <cmath>

namespace rigcal::server {
namespace {

// Distorted coordinates, with derivatives by the undistorted ones and by the coefficients.
struct Distortion {
  Eigen::Vector2d point;
  Eigen::Matrix2d d_xy;
  Eigen::Matrix<double, 2, 8> d_coefficients;
};

// What is not asked for is not computed.
struct Wanted {
  bool d_point, d_coefficients;
};

bool DistortPolynomial(const double* k, bool rational, double x, double y, Wanted wanted,
                       Distortion* out) {
  const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
  const double numerator = 1 + k[0] * r2 + k[1] * r4 + k[4] * r6;
  const double denominator = rational ? 1 + k[5] * r2 + k[6] * r4 + k[7] * r6 : 1;
  if (!(denominator > 0)) return false;
  const double inverse = 1 / denominator;
  const double radial = numerator * inverse;
  const double p1 = k[2], p2 = k[3];
  out->point = {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
  if (wanted.d_point) {
    double slope = (k[0] + 2 * k[1] * r2 + 3 * k[4] * r4) * inverse;
    if (rational) slope -= radial * inverse * (k[5] + 2 * k[6] * r2 + 3 * k[7] * r4);
    const double cross = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y;
    out->d_xy << radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x, cross, cross,
        radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x;
  }
  if (!wanted.d_coefficients) return true;
  const Eigen::Vector2d xy(x, y);
  out->d_coefficients.col(0) = xy * (r2 * inverse);
  out->d_coefficients.col(1) = xy * (r4 * inverse);
  out->d_coefficients.col(2) << 2 * x * y, r2 + 2 * y * y;
  out->d_coefficients.col(3) << r2 + 2 * x * x, 2 * x * y;
  out->d_coefficients.col(4) = xy * (r6 * inverse);
  if (rational) {
    out->d_coefficients.col(5) = xy * (-radial * r2 * inverse);
    out->d_coefficients.col(6) = xy * (-radial * r4 * inverse);
    out->d_coefficients.col(7) = xy * (-radial * r6 * inverse);
  } else {
    out->d_coefficients.rightCols<3>().setZero();
  }
  return true;
}

// Distorted coordinates of a point before an equidistant camera, by the point itself: the model
// bends angles, not normalised coordinates.
void DistortFisheye(const double* k, const Eigen::Vector3d& point, Eigen::Vector2d* distorted,
                    Eigen::Matrix<double, 2, 3>* d_point,
                    Eigen::Matrix<double, 2, 8>* d_coefficients) {
  const double x = point.x(), y = point.y(), z = point.z();
  const double rho2 = x * x + y * y, rho = std::sqrt(rho2), distance2 = rho2 + z * z;
  const double theta = std::atan2(rho, z), t2 = theta * theta;
  const double t3 = theta * t2, t5 = t3 * t2, t7 = t5 * t2, t9 = t7 * t2;
  const bool on_axis = rho < 1e-8 * z;  // theta / rho is 1 / z to the last digit there
  const double bent = theta + k[0] * t3 + k[1] * t5 + k[2] * t7 + k[3] * t9;
  const double slope = 1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])));
  const double gain = on_axis ? 1 / z : bent / rho;
  const double bend = on_axis ? 0 : (slope * z / distance2 - gain) / rho2;
  *distorted = {x * gain, y * gain};
  *d_point << gain + x * x * bend, x * y * bend, -x * slope / distance2,  //
      x * y * bend, gain + y * y * bend, -y * slope / distance2;
  const Eigen::Vector2d direction =
      on_axis ? Eigen::Vector2d::Zero() : Eigen::Vector2d(x / rho, y / rho);
  d_coefficients->col(0) = direction * t3;
  d_coefficients->col(1) = direction * t5;
  d_coefficients->col(2) = direction * t7;
  d_coefficients->col(3) = direction * t9;
}

}  // namespace

int IntrinsicsSize(DistortionModel model) { return 4 + CoefficientCount(model); }

IntrinsicsVector ToVector(const Intrinsics& intrinsics) {
  IntrinsicsVector values = IntrinsicsVector::Zero(IntrinsicsSize(intrinsics.model));
  values.head<4>() << intrinsics.fx_px, intrinsics.fy_px, intrinsics.cx_px, intrinsics.cy_px;
  for (size_t i = 0; i < intrinsics.distortion.size(); ++i) {
    values[static_cast<Eigen::Index>(i) + 4] = intrinsics.distortion[i];
  }
  return values;
}

Intrinsics FromVector(DistortionModel model, const IntrinsicsVector& values) {
  Intrinsics intrinsics;
  intrinsics.model = model;
  intrinsics.fx_px = values[0];
  intrinsics.fy_px = values[1];
  intrinsics.cx_px = values[2];
  intrinsics.cy_px = values[3];
  intrinsics.distortion.assign(values.data() + 4, values.data() + values.size());
  return intrinsics;
}

std::vector<Intrinsics> CurrentIntrinsics(const BundleProblem& problem) {
  std::vector<Intrinsics> intrinsics;
  for (const BundleCamera& camera : problem.cameras) {
    intrinsics.push_back(FromVector(camera.model, camera.intrinsics));
  }
  return intrinsics;
}

bool ProjectWithJacobian(DistortionModel model, const double* intrinsics,
                         const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* pixel,
                         Eigen::Matrix<double, 2, 3>* d_point, IntrinsicsJacobian* d_intrinsics) {
  const double z = x_in_cam.z();
  if (!(z > 0)) return false;
  const double fx = intrinsics[0], fy = intrinsics[1];
  const double* k = intrinsics + 4;
  Eigen::Vector2d distorted;
  Eigen::Matrix<double, 2, 3> d_distorted;
  Eigen::Matrix<double, 2, 8> d_coefficients;
  if (model == DistortionModel::kFisheye) {
    DistortFisheye(k, x_in_cam, &distorted, &d_distorted, &d_coefficients);
  } else {
    const double inverse_z = 1 / z;
    const double x = x_in_cam.x() * inverse_z, y = x_in_cam.y() * inverse_z;
    const Wanted wanted = {d_point != nullptr, d_intrinsics != nullptr};
    Distortion result;
    if (!DistortPolynomial(k, model == DistortionModel::kRational, x, y, wanted, &result)) {
      return false;
    }
    distorted = result.point;
    if (wanted.d_point) {
      d_distorted.leftCols<2>() = result.d_xy * inverse_z;
      d_distorted.col(2) = result.d_xy * Eigen::Vector2d(-x * inverse_z, -y * inverse_z);
    }
    if (wanted.d_coefficients) d_coefficients = result.d_coefficients;
  }
  *pixel = {fx * distorted.x() + intrinsics[2], fy * distorted.y() + intrinsics[3]};
  if (!pixel->allFinite()) return false;
  if (d_point != nullptr) {
    d_point->row(0) = fx * d_distorted.row(0);
    d_point->row(1) = fy * d_distorted.row(1);
  }
  if (d_intrinsics != nullptr) {
    const int coefficients = CoefficientCount(model);
    d_intrinsics->resize(2, 4 + coefficients);
    d_intrinsics->leftCols<4>() << distorted.x(), 0, 1, 0, 0, distorted.y(), 0, 1;
    d_intrinsics->rightCols(coefficients).row(0) = fx * d_coefficients.row(0).head(coefficients);
    d_intrinsics->rightCols(coefficients).row(1) = fy * d_coefficients.row(1).head(coefficients);
  }
  return true;
}

}  // namespace rigcal::server
