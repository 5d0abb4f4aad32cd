// SPDX-License-Identifier: Apache-2.0
#include "common/lens/circle_image.h"

#include <array>
#include <cmath>
#include <numbers>

#include "common/camera/camera_model.h"

namespace rigcal {
namespace {

constexpr size_t kRimPoints = 64;

}  // namespace

bool CircleOffset(const Intrinsics& intrinsics, const RigidTransform& cam_from_board,
                  const Eigen::Vector3d& centre_in_board_m, double radius_m,
                  Eigen::Vector2d* offset_px) {
  Eigen::Vector2d centre_px;
  if (!Project(intrinsics, cam_from_board * centre_in_board_m, &centre_px)) return false;
  std::array<Eigen::Vector2d, kRimPoints> rim_px;  // from the centre's image
  for (size_t k = 0; k < kRimPoints; ++k) {
    const double turn = 2 * std::numbers::pi * static_cast<double>(k) / kRimPoints;
    const Eigen::Vector3d rim_m =
        centre_in_board_m + radius_m * Eigen::Vector3d(std::cos(turn), std::sin(turn), 0);
    if (!Project(intrinsics, cam_from_board * rim_m, &rim_px[k])) return false;
    rim_px[k] -= centre_px;
  }
  double twice_area = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (size_t k = 0; k < kRimPoints; ++k) {
    const Eigen::Vector2d& a = rim_px[k];
    const Eigen::Vector2d& b = rim_px[(k + 1) % kRimPoints];
    const double cross = a.x() * b.y() - a.y() * b.x();
    twice_area += cross;
    sum += cross * (a + b);
  }
  if (!(std::abs(twice_area) > 0)) return false;
  *offset_px = sum / (3 * twice_area);
  return offset_px->allFinite();
}

}  // namespace rigcal
