// SPDX-License-Identifier: Apache-2.0
#include "common/origin/frame_fit.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace rigcal {
namespace {

constexpr double kStepM = 1e-5;

Eigen::Vector3d WeightedMean(const std::vector<Eigen::Vector3d>& points_m,
                             const std::vector<double>& weights) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weight = 0;
  for (size_t i = 0; i < points_m.size(); ++i) {
    sum += weights[i] * points_m[i];
    weight += weights[i];
  }
  return sum / weight;
}

}  // namespace

PlaneFit FitPlane(const std::vector<Eigen::Vector3d>& points_m,
                  const std::vector<double>& weights) {
  PlaneFit plane;
  plane.centre_m = WeightedMean(points_m, weights);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  double weight = 0;
  for (size_t i = 0; i < points_m.size(); ++i) {
    const Eigen::Vector3d from = points_m[i] - plane.centre_m;
    scatter += weights[i] * from * from.transpose();
    weight += weights[i];
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter / weight);
  plane.normal = solver.eigenvectors().col(0);
  plane.spread_m = solver.eigenvalues().reverse().cwiseMax(0).cwiseSqrt();
  return plane;
}

RigidTransform FloorFrame(const std::vector<Eigen::Vector3d>& points_m,
                          const std::vector<double>& weights, size_t first, size_t second,
                          double height_m, const Eigen::Vector3d& inside) {
  const PlaneFit plane = FitPlane(points_m, weights);
  const double side = plane.normal.dot(inside - plane.centre_m) < 0 ? -1 : 1;
  const Eigen::Vector3d z = side * plane.normal;
  const auto on_floor = [&](const Eigen::Vector3d& point) -> Eigen::Vector3d {
    return point - (z.dot(point - plane.centre_m) + height_m) * z;
  };
  const Eigen::Vector3d origin = on_floor(points_m[first]);
  const Eigen::Vector3d x = (on_floor(points_m[second]) - origin).normalized();
  Eigen::Matrix3d new_from_rig;
  new_from_rig.row(0) = x.transpose();
  new_from_rig.row(1) = z.cross(x).transpose();
  new_from_rig.row(2) = z.transpose();
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(new_from_rig).normalized();
  return {rotation, -(rotation * origin)};
}

RigidTransform AlignPoints(const std::vector<Eigen::Vector3d>& a_m,
                           const std::vector<Eigen::Vector3d>& b_m,
                           const std::vector<double>& weights) {
  const Eigen::Vector3d mean_a = WeightedMean(a_m, weights), mean_b = WeightedMean(b_m, weights);
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < a_m.size(); ++i) {
    correlation += weights[i] * (b_m[i] - mean_b) * (a_m[i] - mean_a).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(correlation,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d proper = Eigen::Matrix3d::Identity();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) proper(2, 2) = -1;
  const Eigen::Quaterniond rotation =
      Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * proper * svd.matrixV().transpose()))
          .normalized();
  return {rotation, mean_b - rotation * mean_a};
}

Eigen::Matrix<double, 6, 1> FrameDifference(const RigidTransform& a, const RigidTransform& b) {
  const Eigen::AngleAxisd turn(Canonical(b.rotation * a.rotation.conjugate()));
  Eigen::Matrix<double, 6, 1> difference;
  difference << turn.angle() * turn.axis(), b.translation_m - a.translation_m;
  return difference;
}

FrameDerivatives Differentiate(const FrameOfPoints& frame_of,
                               const std::vector<Eigen::Vector3d>& points_m) {
  FrameDerivatives derivatives(6, static_cast<Eigen::Index>(3 * points_m.size()));
  std::vector<Eigen::Vector3d> moved = points_m;
  for (size_t i = 0; i < points_m.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      moved[i][axis] = points_m[i][axis] + kStepM;
      const RigidTransform plus = frame_of(moved);
      moved[i][axis] = points_m[i][axis] - kStepM;
      const RigidTransform minus = frame_of(moved);
      moved[i][axis] = points_m[i][axis];
      derivatives.col(static_cast<Eigen::Index>(3 * i) + axis) =
          FrameDifference(minus, plus) / (2 * kStepM);
    }
  }
  return derivatives;
}

}  // namespace rigcal
