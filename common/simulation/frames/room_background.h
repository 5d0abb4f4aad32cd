// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/frames/edge_profile.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/simulation/frames/light_model.h"

namespace rigcal {

// The room without a wand, in linear light (see sensor_noise.h), three values per pixel: a wall of
// slowly varying reflectance and, by `clutter`, about 28 things before it at 1: warm and neutral
// patches in light of their own strength, wood, lamps, and lights of the wand's own colour; and the
// furniture (room_furniture.h). `photograph`, if not null, takes the place of the wall
// (RoomPainter). Follows from the options' seed.
std::vector<int16_t> RenderRoom(const ImageSize& image_size, const FrameRenderOptions& options,
                                const LightModel& light, const EdgeProfile& profile,
                                const std::vector<float>* photograph = nullptr);

}  // namespace rigcal
