// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/resection.h"

#include <algorithm>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>

namespace rigcal::server {
namespace {

constexpr size_t kMaxSights = 600;
constexpr int kMinResectionSights = 30;
constexpr int kResectionSamples = 300;

}  // namespace

std::optional<RigidTransform> Resect(const std::vector<PointAndRay>& sights, double threshold,
                                     double min_share) {
  if (static_cast<int>(sights.size()) < kMinResectionSights) return std::nullopt;
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> rays;
  const size_t count = std::min(sights.size(), kMaxSights);
  for (size_t i = 0; i < count; ++i) {
    const PointAndRay& sight = sights[i * sights.size() / count];
    points.emplace_back(sight.x_in_rig.x(), sight.x_in_rig.y(), sight.x_in_rig.z());
    rays.emplace_back(sight.ray.x(), sight.ray.y());
  }
  cv::Mat rotation_vector, translation, inliers, rotation_matrix;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation_m;
  try {
    if (!cv::solvePnPRansac(points, rays, cv::Mat::eye(3, 3, CV_64F), cv::noArray(),
                            rotation_vector, translation, false, kResectionSamples,
                            static_cast<float>(threshold), 0.999, inliers, cv::SOLVEPNP_EPNP)) {
      return std::nullopt;
    }
    cv::Rodrigues(rotation_vector, rotation_matrix);
    cv::cv2eigen(rotation_matrix, rotation);
    cv::cv2eigen(translation, translation_m);
  } catch (const cv::Exception&) {
    return std::nullopt;  // degenerate
  }
  if (inliers.rows < min_share * static_cast<double>(count)) return std::nullopt;
  if (!rotation.allFinite() || !translation_m.allFinite()) return std::nullopt;
  return RigidTransform{Eigen::Quaterniond(rotation).normalized(), translation_m};
}

}  // namespace rigcal::server
