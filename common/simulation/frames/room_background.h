// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/frames/edge_profile.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/simulation/frames/light_model.h"

namespace rigcal {

// Share of the light that the lens passes at a pixel: 1 in the middle, 1 - vignetting in the
// corners.
double VignettingAt(const ImageSize& image_size, double vignetting, double x_px, double y_px);

// The room without a wand, in linear light (see sensor_noise.h), three values per pixel: a wall of
// slowly varying reflectance and, by `clutter`, about 28 things before it at 1: warm and neutral
// patches in light of their own strength, wood, lamps, and lights of the wand's own colour. Follows
// from the options' seed.
std::vector<int16_t> RenderRoom(const ImageSize& image_size, const FrameRenderOptions& options,
                                const LightModel& light, const EdgeProfile& profile);

}  // namespace rigcal
