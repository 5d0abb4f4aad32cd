// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/room_background.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "common/simulation/frames/room_furniture.h"
#include "common/simulation/frames/room_painter.h"
#include "common/simulation/world/random_stream.h"

namespace rigcal {
namespace {

constexpr uint64_t kRoomPurpose = 0x726f6f6d;
constexpr double kThingsAtOne = 28;

Bgr Scaled(Bgr colour, double factor) {
  for (double& channel : colour) channel *= factor;
  return colour;
}

RoomShape DrawThing(const ImageSize& image_size, const LightModel& light, RandomStream random) {
  RoomShape thing;
  const double kind = random.Uniform();
  const double angle = random.Uniform(0, std::numbers::pi);
  thing.axis = {std::cos(angle), std::sin(angle)};
  thing.centre_px = {random.Uniform() * image_size.width, random.Uniform() * image_size.height};
  const double side_px = 0.5 * (image_size.width + image_size.height);
  const double size_px = side_px * random.LogUniform(0.006, 0.12);
  thing.half_px = {size_px, size_px * random.Uniform(0.3, 1)};
  thing.round = random.Uniform() < 0.4;
  const double warm_hue_deg = random.Uniform(8, 48), saturation = random.Uniform(0.3, 0.9);
  // Some things stand in the sun or under a lamp, others in the shade.
  const double surface_grey = light.grey_per_cd_m2 * light.room_cd_m2 * random.Uniform(0.2, 0.8) *
                              random.LogUniform(0.4, 5);
  const double lamp_cd_m2 = random.LogUniform(60, 4000);
  if (kind < 0.4) {
    thing.bgr_grey = Scaled(HueColour(warm_hue_deg, saturation), surface_grey);
  } else if (kind < 0.65) {
    thing.bgr_grey = Scaled(HueColour(random.Uniform(18, 36), 0.6), surface_grey);
    thing.half_px *= 1.8;
    thing.round = false;
    thing.grain_px = random.Uniform(3, 14);
    thing.grain_bend = random.Uniform(0.002, 0.02);
  } else if (kind < 0.8) {
    thing.bgr_grey = Scaled(HueColour(random.Uniform(0, 360), 0.3), surface_grey);
  } else {
    // Lamps; one in four a small light of the wand's kind.
    const bool small = kind > 0.95;
    thing.bgr_grey = Scaled(HueColour(random.Uniform(15, 45), small ? 0.8 : 0.3),
                            light.grey_per_cd_m2 * lamp_cd_m2);
    const double radius_px = random.LogUniform(2.5, small ? 8 : 25);
    thing.half_px = {radius_px, radius_px * random.Uniform(0.7, 1)};
    thing.round = thing.glows = true;
  }
  return thing;
}

}  // namespace

std::vector<int16_t> RenderRoom(const ImageSize& image_size, const FrameRenderOptions& options,
                                const LightModel& light, const EdgeProfile& profile,
                                const std::vector<float>* photograph) {
  RoomPainter painter(image_size, options, light, profile);
  painter.PaintWall();
  if (photograph != nullptr) painter.PaintPhotograph(*photograph);
  PaintFurniture(options, &painter);
  const int count = static_cast<int>(std::lround(kThingsAtOne * options.clutter));
  for (int i = 0; i < count; ++i) {
    painter.Paint(DrawThing(
        image_size, light, RandomStream{options.seed, kRoomPurpose, static_cast<uint64_t>(i + 1)}));
  }
  return painter.Linear();
}

}  // namespace rigcal
