// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_difference.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <numbers>
#include <vector>

#include "common/camera/camera_model.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal {
namespace {

constexpr int kGridColumns = LensDifference::kColumns, kGridRows = LensDifference::kRows;
constexpr int kRotationSteps = 10;
constexpr double kRotationLossPx = 1;
constexpr double kLeastCommonShare = 0.25;

struct GridRay {
  size_t index;  // in the grid
  Eigen::Vector2d pixel;
  Eigen::Vector3d direction;
};

}  // namespace

absl::StatusOr<LensDifference> CompareLenses(const Intrinsics& a, const Intrinsics& b,
                                             const ImageSize& image_size_px) {
  std::vector<GridRay> rays;
  for (int row = 0; row < kGridRows; ++row) {
    for (int column = 0; column < kGridColumns; ++column) {
      const Eigen::Vector2d pixel = LensDifference::GridPixel(image_size_px, row, column);
      const absl::StatusOr<Eigen::Vector2d> ray = Undistort(a, pixel);
      if (ray.ok() && Undistort(b, pixel).ok()) {
        rays.push_back({static_cast<size_t>(row * kGridColumns + column), pixel,
                        Eigen::Vector3d(ray->x(), ray->y(), 1).normalized()});
      }
    }
  }
  constexpr double kPixels = kGridColumns * kGridRows;
  if (static_cast<double>(rays.size()) < kLeastCommonShare * kPixels) {
    return absl::FailedPreconditionError(
        "the two lenses have rays in less than a quarter of the image in common");
  }
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  for (int step = 0; step < kRotationSteps; ++step) {
    Eigen::Matrix3d information = 1e-9 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (const GridRay& ray : rays) {
      const Eigen::Vector3d turned = rotation * ray.direction;
      Eigen::Vector2d pixel;
      Eigen::Matrix<double, 2, 3> d_point;
      if (!Project(b, turned, &pixel, &d_point)) continue;
      const Eigen::Vector2d error = pixel - ray.pixel;
      const double weight = 1 / (1 + error.squaredNorm() / (kRotationLossPx * kRotationLossPx));
      Eigen::Matrix<double, 2, 3> d_turn;  // turned + turn x turned
      for (int k = 0; k < 3; ++k) {
        d_turn.col(k) = d_point * Eigen::Vector3d::Unit(k).cross(turned);
      }
      information += weight * d_turn.transpose() * d_turn;
      gradient += weight * d_turn.transpose() * error;
    }
    const Eigen::Vector3d turn = -information.ldlt().solve(gradient);
    const double angle = turn.norm();
    if (!(angle > 1e-14)) break;
    rotation = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() * rotation;
  }
  LensDifference difference;
  difference.map_px.assign(kGridColumns * kGridRows, std::numeric_limits<double>::quiet_NaN());
  std::vector<double> distances;
  for (const GridRay& ray : rays) {
    Eigen::Vector2d pixel;
    if (!Project(b, rotation * ray.direction, &pixel)) continue;
    distances.push_back((pixel - ray.pixel).norm());
    difference.map_px[ray.index] = distances.back();
  }
  if (static_cast<double>(distances.size()) < kLeastCommonShare * kPixels) {
    return absl::FailedPreconditionError("the two lenses do not look the same way");
  }
  difference.turned_deg = Eigen::AngleAxisd(rotation).angle() * 180 / std::numbers::pi;
  difference.median_px = InterpolatedQuantile(distances, 0.5);
  difference.p95_px = InterpolatedQuantile(distances, 0.95);
  difference.most_px = *std::max_element(distances.begin(), distances.end());
  difference.unknown_share = 1 - static_cast<double>(distances.size()) / kPixels;
  return difference;
}

}  // namespace rigcal
