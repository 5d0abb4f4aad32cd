// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/circle_projection.h"

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "common/camera/camera_model.h"
#include "common/geometry/rigid_transform.h"
#include "common/lens/circle_image.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

constexpr size_t kLeastPosePoints = 6;

}  // namespace

void CorrectCircles(const Board& board, const Intrinsics& intrinsics,
                    std::vector<Eigen::Vector2d>* pixels) {
  if (!board.HasCircles()) return;
  const std::vector<Eigen::Vector3d> points = board.Points();
  std::vector<cv::Point3d> in_board;
  std::vector<cv::Point2d> rays;
  for (size_t i = 0; i < points.size(); ++i) {
    const auto ray = Undistort(intrinsics, (*pixels)[i]);
    if (!ray.ok()) continue;
    in_board.emplace_back(points[i].x(), points[i].y(), points[i].z());
    rays.emplace_back(ray->x(), ray->y());
  }
  cv::Mat1d turn, shift;
  if (in_board.size() < kLeastPosePoints ||
      !cv::solvePnP(in_board, rays, cv::Matx33d::eye(), cv::noArray(), turn, shift, false,
                    cv::SOLVEPNP_IPPE)) {
    return;
  }
  const Eigen::Vector3d axis(turn(0), turn(1), turn(2));
  RigidTransform cam_from_board;
  if (axis.norm() > 0) {
    cam_from_board.rotation = Eigen::AngleAxisd(axis.norm(), axis.normalized());
  }
  cam_from_board.translation_m = {shift(0), shift(1), shift(2)};
  for (size_t i = 0; i < points.size(); ++i) {
    Eigen::Vector2d offset_px;
    if (CircleOffset(intrinsics, cam_from_board, points[i], 0.5 * board.CircleDiameter(),
                     &offset_px)) {
      (*pixels)[i] -= offset_px;
    }
  }
}

double PointSigma(const Board& board, const std::vector<Eigen::Vector2d>& pixels) {
  std::vector<double> differences;
  const auto at = [&](int column, int row) -> const Eigen::Vector2d& {
    return pixels[static_cast<size_t>(row * board.columns + column)];
  };
  const auto add = [&](const Eigen::Vector2d& third) {
    differences.push_back(std::abs(third.x()));
    differences.push_back(std::abs(third.y()));
  };
  // Every second row of circles is shifted: columns are no lines.
  const int row_step = board.kind == BoardKind::kCircles ? 2 : 1;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      if (column + 3 < board.columns) {
        add(at(column + 3, row) - 3 * at(column + 2, row) + 3 * at(column + 1, row) -
            at(column, row));
      }
      if (row + 3 * row_step < board.rows) {
        add(at(column, row + 3 * row_step) - 3 * at(column, row + 2 * row_step) +
            3 * at(column, row + row_step) - at(column, row));
      }
    }
  }
  if (differences.empty()) return 0;
  return kSigmaOverMad * UpperMedian(std::move(differences)) / std::sqrt(20.0);
}

}  // namespace rigcal::agent
