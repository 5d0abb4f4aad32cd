// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/simulation/frames/frame_render_options.h"
#include "common/simulation/frames/room_painter.h"

namespace rigcal {

// Paints what stands in ordinary rooms before the wall, as many of each kind as the options say:
// shelves with books (some of them orange), windows onto a bright outside, screens, ceiling lights,
// warm lamps and small indicator lights, and people, whose skin and some of whose clothes have the
// colour of the wand. Sizes are those of the things at 2.5 to 6 m, seen with a focal length of
// 0.8 image widths. Follows from the options' seed.
void PaintFurniture(const FrameRenderOptions& options, RoomPainter* painter);

}  // namespace rigcal
