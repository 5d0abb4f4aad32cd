// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/rigid_pose.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

namespace rigcal::server {
namespace {

constexpr size_t kMinViewPoints = 4;
// Of the singular values of centred points, as a share of the largest: less is a line or a plane.
constexpr double kLineShare = 0.02;
constexpr double kPlaneShare = 1e-6;
constexpr double kNearPlaneShare = 0.1;

Eigen::Vector3d SingularValues(const std::vector<Eigen::Vector3d>& points_m) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points_m) middle += point;
  middle /= static_cast<double>(points_m.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points_m) {
    scatter += (point - middle) * (point - middle).transpose();
  }
  return Eigen::JacobiSVD<Eigen::Matrix3d>(scatter).singularValues().cwiseSqrt();
}

// Appends the solutions in front of the camera.
void Solve(const RigidView& view, int method, std::vector<RigidTransform>* poses) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> rays;
  for (size_t i = 0; i < view.points_m.size(); ++i) {
    points.emplace_back(view.points_m[i].x(), view.points_m[i].y(), view.points_m[i].z());
    rays.emplace_back(view.rays[i].x(), view.rays[i].y());
  }
  std::vector<cv::Mat> rotations, translations;
  try {
    cv::solvePnPGeneric(points, rays, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotations,
                        translations, false, static_cast<cv::SolvePnPMethod>(method));
    for (size_t i = 0; i < rotations.size(); ++i) {
      cv::Mat matrix;
      cv::Rodrigues(rotations[i], matrix);
      Eigen::Matrix3d rotation;
      Eigen::Vector3d translation_m;
      cv::cv2eigen(matrix, rotation);
      cv::cv2eigen(translations[i], translation_m);
      if (!rotation.allFinite() || !translation_m.allFinite()) continue;
      const RigidTransform pose{Eigen::Quaterniond(rotation).normalized(), translation_m};
      const bool in_front = std::ranges::all_of(
          view.points_m, [&pose](const Eigen::Vector3d& point) { return (pose * point).z() > 0; });
      if (in_front) poses->push_back(pose);
    }
  } catch (const cv::Exception&) {
    return;  // degenerate
  }
}

}  // namespace

RigidView ViewOf(const BundleProblem& problem, const std::vector<Eigen::Vector2d>& rays,
                 const BundleObservation& observation) {
  RigidView view;
  for (const BundleMarker& marker : problem.MarkersOf(observation)) {
    const Eigen::Vector2d& ray = rays[problem.IndexOf(marker)];
    if (!marker.used || !ray.allFinite()) continue;
    view.points_m.push_back(problem.rigid_target.points_m[static_cast<size_t>(marker.marker)]);
    view.rays.push_back(ray);
  }
  return view;
}

std::vector<RigidTransform> EstimateViewPoses(const RigidView& view) {
  std::vector<RigidTransform> poses;
  if (view.points_m.size() < kMinViewPoints) return poses;
  const Eigen::Vector3d sizes = SingularValues(view.points_m);
  if (!(sizes[1] > kLineShare * sizes[0])) return poses;
  if (sizes[2] < kNearPlaneShare * sizes[0]) Solve(view, cv::SOLVEPNP_IPPE, &poses);
  if (sizes[2] > kPlaneShare * sizes[0]) Solve(view, cv::SOLVEPNP_SQPNP, &poses);
  return poses;
}

std::optional<RigidTransform> AlignRigidTarget(const std::vector<Eigen::Vector3d>& points_m,
                                               const std::vector<Eigen::Vector3d>& points_in_rig) {
  if (points_m.size() < 3) return std::nullopt;
  const Eigen::Vector3d sizes = SingularValues(points_m);
  if (!(sizes[1] > kLineShare * sizes[0])) return std::nullopt;
  const auto count = static_cast<Eigen::Index>(points_m.size());
  Eigen::Matrix3Xd from(3, count), to(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    from.col(i) = points_m[static_cast<size_t>(i)];
    to.col(i) = points_in_rig[static_cast<size_t>(i)];
  }
  const Eigen::Matrix4d transform = Eigen::umeyama(from, to, false);
  if (!transform.allFinite()) return std::nullopt;
  const Eigen::Matrix3d rotation = transform.topLeftCorner<3, 3>();
  return RigidTransform{Eigen::Quaterniond(rotation).normalized(),
                        transform.topRightCorner<3, 1>()};
}

}  // namespace rigcal::server
