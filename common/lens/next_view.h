// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
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
  // What the words say: where its middle is (-1 left or up, 0, 1 right or down), whether it is near
  // (it would span two thirds of the image's width or height if it faced the camera in the middle,
  // but not nearer than 0.6 times its diagonal) or 1.6 times as far, by how much it is tilted
  // against the line of sight, and where in the image the side is that is farther away (0 degrees
  // at the right, 90 below).
  int place_x = 0, place_y = 0;
  bool is_near = true;
  double tilt_deg = 0, towards_deg = 0;

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

// Where a board is that is held as the words say, by whoever has it the way round of
// AdviseNextView's last view. None: it does not fit into the image, or the lens cannot show it.
std::optional<RigidTransform> PoseOf(const NextView& next,
                                     const std::vector<Eigen::Vector3d>& points_m,
                                     const Intrinsics& lens, const ImageSize& image_size_px,
                                     const std::vector<BoardView>& views, bool is_whole = true);

}  // namespace rigcal
