// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <random>
#include <string>
#include <vector>

#include "common/board/board.h"
#include "common/camera/camera_model.h"
#include "common/geometry/rigid_transform.h"
#include "common/lens/board_view.h"

namespace rigcal::testing {

inline constexpr ImageSize kKnownImage{640, 480};

inline Intrinsics KnownPinhole() {
  return {.model = DistortionModel::kBrownConrady,
          .fx_px = 520,
          .fy_px = 522,
          .cx_px = 325,
          .cy_px = 236,
          .distortion = {-0.25, 0.09, 0.0007, -0.0005, -0.012}};
}

inline Intrinsics KnownFisheye() {
  return {.model = DistortionModel::kFisheye,
          .fx_px = 260,
          .fy_px = 261,
          .cx_px = 316,
          .cy_px = 243,
          .distortion = {0.03, -0.012, 0.004, -0.001}};
}

// Poses of a board whose middle is at `pixel` of the image, `distance_m` away, turned by these
// angles (about the camera's x, y and z axes).
inline RigidTransform BoardAt(const Board& board, const Intrinsics& lens,
                              const Eigen::Vector2d& pixel, double distance_m,
                              const Eigen::Vector3d& turn_rad) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : board.Points()) middle += point / board.point_count();
  const Eigen::Vector2d ray = *Undistort(lens, pixel);
  RigidTransform pose;
  pose.rotation = Eigen::AngleAxisd(turn_rad.z(), Eigen::Vector3d::UnitZ()) *
                  Eigen::AngleAxisd(turn_rad.y(), Eigen::Vector3d::UnitY()) *
                  Eigen::AngleAxisd(turn_rad.x(), Eigen::Vector3d::UnitX());
  pose.translation_m =
      distance_m * Eigen::Vector3d(ray.x(), ray.y(), 1).normalized() - pose.rotation * middle;
  return pose;
}

// Boards whose middles are all over `reach` of the image's width and height, near and far, tilted
// by half to all of `most_tilt_rad` to every side.
inline std::vector<RigidTransform> WavedBoard(const Board& board, const Intrinsics& lens,
                                              const ImageSize& image, int count, double nearest_m,
                                              double farthest_m, double most_tilt_rad,
                                              uint32_t seed, double reach = 0.57) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<RigidTransform> poses;
  for (int i = 0; i < count; ++i) {
    const double column = (i % 4) / 3.0 - 0.5, row = (i / 4 % 3) / 2.0 - 0.5;
    const Eigen::Vector2d pixel(image.width * (0.5 + reach * column),
                                image.height * (0.5 + reach * row));
    const double towards = 2 * 3.14159265358979 * unit(random);
    const double tilt = most_tilt_rad * (0.5 + 0.5 * unit(random));
    poses.push_back(BoardAt(
        board, lens, pixel, nearest_m + (farthest_m - nearest_m) * unit(random),
        Eigen::Vector3d(tilt * std::cos(towards), tilt * std::sin(towards), unit(random) - 0.5)));
  }
  return poses;
}

// What a lens shows of a board, with noise of one sigma in each coordinate; points outside of the
// image are missing.
inline std::vector<BoardView> SeenBoards(const Board& board, const Intrinsics& lens,
                                         const ImageSize& image,
                                         const std::vector<RigidTransform>& poses, double sigma_px,
                                         uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1);
  std::vector<BoardView> views;
  for (const RigidTransform& pose : poses) {
    BoardView view;
    view.name = "view " + std::to_string(views.size());
    for (const Eigen::Vector3d& point : board.Points()) {
      Eigen::Vector2d pixel;
      if (!Project(lens, pose * point, &pixel)) continue;
      pixel += sigma_px * Eigen::Vector2d(noise(random), noise(random));
      if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() > image.width - 1 ||
          pixel.y() > image.height - 1) {
        continue;
      }
      view.corners.push_back({point, pixel});
    }
    if (view.corners.size() >= 12) views.push_back(view);
  }
  return views;
}

}  // namespace rigcal::testing
