// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/held_board.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/camera/camera_model.h"

namespace rigcal {
namespace {

constexpr double kLeastShare = 0.35, kMostShare = 0.55;  // of the image, by the board
constexpr double kLeastTiltRad = 0.44, kMostTiltRad = 0.79;
constexpr double kMostRollRad = 0.5;
// No two have a common multiple within minutes.
constexpr double kAcrossS = 7.3, kDownS = 4.7, kNearS = 11.9, kTowardsS = 5.9, kTiltS = 13.7,
                 kRollS = 17.3;

// From -1 to 1.
double Swing(double time_s, double period_s, double phase) {
  return std::sin(2 * std::numbers::pi * (time_s / period_s + phase));
}

double Between(double low, double high, double swing) {
  return low + (high - low) * 0.5 * (1 + swing);
}

}  // namespace

RigidTransform HeldBoard(const Board& board, const Intrinsics& lens, const ImageSize& image_size_px,
                         double time_s, uint32_t seed) {
  const double phase = 0.618034 * seed;  // the golden ratio: seeds are spread evenly
  Eigen::Vector3d low_m(0, 0, 0), high_m(0, 0, 0);
  for (const Eigen::Vector3d& point : board.OneSide().Points()) {
    low_m = low_m.cwiseMin(point);
    high_m = high_m.cwiseMax(point);
  }
  const Eigen::Vector3d middle_m = 0.5 * (low_m + high_m);
  const Eigen::Array2d size_px(image_size_px.width, image_size_px.height);
  const double share = Between(kLeastShare, kMostShare, Swing(time_s, kNearS, 2.3 * phase));
  // All of it stays in the image.
  const double reach = 0.5 * (1 - share);
  const Eigen::Array2d swing(Swing(time_s, kAcrossS, phase), Swing(time_s, kDownS, 1.7 * phase));
  const auto undistorted = Undistort(lens, (size_px * (0.5 + reach * swing)).matrix());
  const Eigen::Vector2d ray = undistorted.ok() ? *undistorted : Eigen::Vector2d(0, 0);
  const Eigen::Array2d extent_m = (high_m - low_m).head<2>();
  const double distance_m = lens.fx_px * (extent_m / (share * size_px)).maxCoeff();
  const double tilt = Between(kLeastTiltRad, kMostTiltRad, Swing(time_s, kTiltS, 3.1 * phase));
  const double towards = 2 * std::numbers::pi * (time_s / kTowardsS + phase);
  RigidTransform pose;
  pose.rotation =
      Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(towards), std::sin(towards), 0)) *
      Eigen::AngleAxisd(kMostRollRad * Swing(time_s, kRollS, phase), Eigen::Vector3d::UnitZ());
  // Its z points to who looks at it.
  if (board.kind == BoardKind::kAprilGrid) {
    pose.rotation = pose.rotation * Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX());
  }
  pose.translation_m =
      distance_m * Eigen::Vector3d(ray.x(), ray.y(), 1).normalized() - pose.rotation * middle_m;
  return pose;
}

}  // namespace rigcal
