// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "common/board/board.h"
#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal {

// Pictures of one camera with a known lens. Of each pixel 4 x 4 places are looked at, each along
// its own ray; the rays are those of every second pixel, with linear interpolation between them
// (below 0.002 px off for usual lenses).
class BoardRenderer {
 public:
  BoardRenderer(const Intrinsics& lens, const ImageSize& image);

  // CV_8UC1: the board's black and white on a grey ground, with a white margin as wide as a square.
  // Of a board with two sides, the one that faces the camera. `blur_px`: sigma of the lens;
  // `noise_grey`: sigma in grey levels, drawn from `seed`.
  cv::Mat Render(const Board& board, const RigidTransform& cam_from_board, double blur_px,
                 double noise_grey, uint64_t seed = 7) const;

 private:
  const Eigen::Vector3f& Ray(int column, int row) const;

  // The part of the image that the board may be in.
  cv::Rect PartWith(const Board& board, const RigidTransform& cam_from_board) const;

  const Intrinsics lens_;
  const ImageSize image_;
  int columns_ = 0;  // of the table of rays
  int rows_ = 0;
  std::vector<Eigen::Vector3f> rays_;
};

}  // namespace rigcal
