// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"
#include "common/lens/board_view.h"
#include "common/lens/lens_adjustment.h"
#include "common/lens/lens_model.h"

namespace rigcal {

// A lens without distortion, with its middle in the middle of the image, and the poses that belong
// to it: of many focal lengths that whose poses show the boards best. The pose of a view is the
// decomposed homography (Zhang 2000, section 3.1), refined. Of `model` only counts whether it is a
// fisheye. FAILED_PRECONDITION: with no focal length could most of the boards be placed before the
// camera.
absl::StatusOr<LensEstimate> StartLens(LensModel model, const ImageSize& image_size_px,
                                       const std::vector<BoardView>& views);

// The board's pose in one view, and the median distance of its corners from their projections.
struct PlacedBoard {
  RigidTransform cam_from_board;
  double error_px = kUnseenPx;
};
// With that lens. A board that cannot be placed is somewhere before the camera: other views may
// pull the lens right.
PlacedBoard PlaceBoard(LensModel model, const BoardView& view, const Intrinsics& lens);

}  // namespace rigcal
