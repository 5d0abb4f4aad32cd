// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/triangulation.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "server/solve/geometry/null_vector.h"

namespace rigcal::server {
namespace {

constexpr double kMinSinAngle = 1e-4;
constexpr int kTriangulationSteps = 5;
// One view of so many hardly moves the point: its part is taken out to second order. Where the
// point moves by more than this share of its depth, it is triangulated anew.
constexpr size_t kManyViews = 5;
constexpr double kLinearShare = 1e-3;

Eigen::Vector3d Bearing(const CameraRay& view) {
  return view.cam_from_rig.rotation.conjugate() *
         Eigen::Vector3d(view.ray.x(), view.ray.y(), 1).normalized();
}

bool AllBefore(const std::vector<CameraRay>& views, const Eigen::Vector3d& point) {
  return point.allFinite() && std::ranges::all_of(views, [&point](const CameraRay& view) {
           return (view.cam_from_rig * point).z() > 1e-9;
         });
}

// Half the weighted squared residuals of one or more views near a point, to second order.
struct Quadratic {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();

  void Add(const CameraRay& view, const Eigen::Vector3d& point) {
    const Eigen::Matrix3d rotation = view.cam_from_rig.rotation.toRotationMatrix();
    const Eigen::Vector3d x = rotation * point + view.cam_from_rig.translation_m;
    const double inverse_z = 1 / x.z();
    Eigen::Matrix<double, 2, 3> jacobian;
    jacobian << inverse_z, 0, -x.x() * inverse_z * inverse_z,  //
        0, inverse_z, -x.y() * inverse_z * inverse_z;
    const Eigen::Matrix<double, 2, 3> d_rig = jacobian * rotation;
    const Eigen::Vector2d residual = x.head<2>() * inverse_z - view.ray;
    hessian += view.weight * d_rig.transpose() * d_rig;
    gradient += view.weight * d_rig.transpose() * residual;
  }
  Eigen::Vector3d Step() const { return -hessian.ldlt().solve(gradient); }
};

void Refine(const std::vector<CameraRay>& views, Eigen::Vector3d* point) {
  for (int step = 0; step < kTriangulationSteps; ++step) {
    Quadratic all;
    for (const CameraRay& view : views) all.Add(view, *point);
    const Eigen::Vector3d delta = all.Step();
    const Eigen::Vector3d next = *point + delta;
    if (!AllBefore(views, next)) return;
    *point = next;
    if (delta.norm() < 1e-12) return;
  }
}

std::vector<CameraRay> Without(std::vector<CameraRay> views, size_t index) {
  views.erase(views.begin() + static_cast<std::ptrdiff_t>(index));
  return views;
}

}  // namespace

std::optional<Eigen::Vector3d> TriangulatePair(const CameraRay& a, const CameraRay& b) {
  // Least squares of the distances along both bearings; equal to the linear method for two views.
  const Eigen::Vector3d da = Bearing(a), db = Bearing(b);
  if (!(da.cross(db).norm() > kMinSinAngle)) return std::nullopt;
  const Eigen::Vector3d ca = a.cam_from_rig.SourceFromTargetTranslation();
  const Eigen::Vector3d cb = b.cam_from_rig.SourceFromTargetTranslation();
  const Eigen::Vector3d base = cb - ca;
  const double cosine = da.dot(db), scale = 1 / (1 - cosine * cosine);
  const double along_a = (da.dot(base) - cosine * db.dot(base)) * scale;
  const double along_b = (cosine * da.dot(base) - db.dot(base)) * scale;
  if (!(along_a > 0) || !(along_b > 0)) return std::nullopt;
  const Eigen::Vector3d point = 0.5 * (ca + along_a * da + cb + along_b * db);
  return AllBefore({a, b}, point) ? std::optional(point) : std::nullopt;
}

double RayError(const CameraRay& view, const Eigen::Vector3d& x_in_rig) {
  return ((view.cam_from_rig * x_in_rig).hnormalized() - view.ray).norm();
}

std::optional<Eigen::Vector3d> Triangulate(const std::vector<CameraRay>& views) {
  if (views.size() < 2) return std::nullopt;
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  double max_sine = 0;
  const Eigen::Vector3d first = Bearing(views.front());
  for (const CameraRay& view : views) {
    Eigen::Matrix<double, 3, 4> projection;
    projection.leftCols<3>() = view.cam_from_rig.rotation.toRotationMatrix();
    projection.col(3) = view.cam_from_rig.translation_m;
    for (int row = 0; row < 2; ++row) {
      const Eigen::Vector4d equation =
          (view.ray[row] * projection.row(2) - projection.row(row)).transpose();
      normal += equation * equation.transpose();
    }
    max_sine = std::max(max_sine, first.cross(Bearing(view)).norm());
  }
  if (!(max_sine > kMinSinAngle)) return std::nullopt;
  const Eigen::Vector4d homogeneous = NullVector(normal);
  if (!(std::abs(homogeneous[3]) > 1e-12)) return std::nullopt;
  Eigen::Vector3d point = homogeneous.head<3>() / homogeneous[3];
  if (!AllBefore(views, point)) return std::nullopt;
  Refine(views, &point);
  return point;
}

std::vector<std::optional<Eigen::Vector3d>> TriangulateWithoutEach(
    const std::vector<CameraRay>& views) {
  std::vector<std::optional<Eigen::Vector3d>> points(views.size());
  std::optional<Eigen::Vector3d> all;
  if (views.size() >= kManyViews) all = Triangulate(views);
  if (!all) {
    for (size_t i = 0; i < views.size(); ++i) points[i] = Triangulate(Without(views, i));
    return points;
  }
  std::vector<Quadratic> own(views.size());
  Quadratic sum;
  for (size_t i = 0; i < views.size(); ++i) {
    own[i].Add(views[i], *all);
    sum.hessian += own[i].hessian;
    sum.gradient += own[i].gradient;
  }
  for (size_t i = 0; i < views.size(); ++i) {
    const Quadratic others = {sum.hessian - own[i].hessian, sum.gradient - own[i].gradient};
    const Eigen::Vector3d step = others.Step();
    // So far the views are not linear.
    const double depth_m = (views[i].cam_from_rig * *all).z();
    points[i] = step.norm() < kLinearShare * depth_m ? std::optional<Eigen::Vector3d>(*all + step)
                                                     : Triangulate(Without(views, i));
  }
  return points;
}

}  // namespace rigcal::server
