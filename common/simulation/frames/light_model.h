// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "common/simulation/frames/frame_render_options.h"
#include "common/target/target.h"

namespace rigcal {

// Blue, green, red.
using Bgr = std::array<double, 3>;

// A colour of brightness 1 in its brightest channel. Hue in degrees on the colour hexagon,
// saturation 0 to 1.
Bgr HueColour(double hue_deg, double saturation);

// How often a marker's LED blinks, and the radius of its sphere: 20 mm if the target says none.
double BlinkHz(const Target& target, const FrameRenderOptions& options, size_t marker);
double SphereRadiusM(const Target& target);

// The photometry of FrameRenderOptions, worked out: luminance to grey levels above black.
struct LightModel {
  double grey_per_cd_m2 = 0;  // of white light that shines during the whole exposure
  Bgr led_grey{};             // a sphere lit during the whole exposure
  double shell_grey = 0;      // what a sphere's white shell adds under the ambient light
  double spot_grey = 0;       // and under the overhead light, where it faces it
  double room_cd_m2 = 0;      // luminance of a surface of reflectance 1

  explicit LightModel(const FrameRenderOptions& options);
};

}  // namespace rigcal
