// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "common/board/board.h"
#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal {

// Where somebody holds a board before one camera to calibrate its lens: it wanders over the whole
// image, near, tilted by 25 to 45 degrees to every side in turn. Smooth in time; another path for
// every seed. `cam_from_board`.
RigidTransform HeldBoard(const Board& board, const Intrinsics& lens, const ImageSize& image_size_px,
                         double time_s, uint32_t seed);

}  // namespace rigcal
