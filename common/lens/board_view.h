// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace rigcal {

// A point of a board and the pixel that shows it; the centre of the first pixel is (0, 0). Of a
// circle, the pixel is the centroid of its image.
struct BoardCorner {
  Eigen::Vector3d x_in_board_m = Eigen::Vector3d::Zero();  // z = 0
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double radius_m = 0;  // of a circle; 0: a point
};

// What one picture shows of a board.
struct BoardView {
  std::string name;  // for people: "picture 12"
  std::vector<BoardCorner> corners;
  int64_t time_ns = 0;  // by the camera's clock; 0: not known
};

}  // namespace rigcal
