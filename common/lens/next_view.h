// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"
#include "common/lens/board_view.h"
#include "common/lens/lens_solver.h"

namespace rigcal {

// Where to hold the board next.
struct NextView {
  // "hold the board at the upper left, near, with its right side turned away from the camera by
  // about 45 degrees"; left and right are those of the image.
  std::string words;
  // Without a lens: the identity.
  RigidTransform cam_from_board;
  // The hull of the board's corners, projected; empty without a lens.
  std::vector<Eigen::Vector2d> outline_px;
  // The lens' uncertainty over the image with this view; not a number without a lens.
  double expected_p95_px = std::numeric_limits<double>::quiet_NaN();
};

// Of many poses (places over the image, near and far, upright and tilted by 30 and 45 degrees in 8
// directions) the one that lowers the mean variance of the projection over the image most. A lens
// that has not been solved yet needs no more than a fixed list: the middle, tilted to each side,
// then the corners of the image.
//
// `points_m`: of the board, in its frame. `views`: so far; which way round the board is held is
// taken from the last one. `solution`: of these views, or null. `is_whole`: the board is found only
// where all of it is in the image.
NextView AdviseNextView(const std::vector<Eigen::Vector3d>& points_m,
                        const ImageSize& image_size_px, const std::vector<BoardView>& views,
                        const LensSolution* solution, bool is_whole = true);

}  // namespace rigcal
