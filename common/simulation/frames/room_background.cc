// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/room_background.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "common/simulation/frames/sensor_noise.h"
#include "common/simulation/world/random_stream.h"

namespace rigcal {
namespace {

constexpr uint64_t kRoomPurpose = 0x726f6f6d;
constexpr double kThingsAtOne = 28;
constexpr double kLampHaloReach = 5;

double LogUniform(RandomStream* random, double low, double high) {
  return low * std::pow(high / low, random->Uniform());
}

// An object before the wall: a rotated rectangle or ellipse. `bgr_grey` is its light without
// vignetting; wood has rings besides.
struct Thing {
  Eigen::Vector2d centre_px;
  Eigen::Vector2d axis;
  Eigen::Vector2d half_px;
  Bgr bgr_grey{};
  bool round = false;
  bool glows = false;
  double grain_px = 0;  // width of the rings of wood
  double grain_bend = 0;
};

Bgr Scaled(Bgr colour, double factor) {
  for (double& channel : colour) channel *= factor;
  return colour;
}

Thing DrawThing(const ImageSize& image_size, const LightModel& light, RandomStream random) {
  Thing thing;
  const double kind = random.Uniform();
  const double angle = random.Uniform(0, std::numbers::pi);
  thing.axis = {std::cos(angle), std::sin(angle)};
  thing.centre_px = {random.Uniform() * image_size.width, random.Uniform() * image_size.height};
  const double side_px = 0.5 * (image_size.width + image_size.height);
  const double size_px = side_px * LogUniform(&random, 0.006, 0.12);
  thing.half_px = {size_px, size_px * random.Uniform(0.3, 1)};
  thing.round = random.Uniform() < 0.4;
  const double warm_hue_deg = random.Uniform(8, 48), saturation = random.Uniform(0.3, 0.9);
  // Some things stand in the sun or under a lamp, others in the shade.
  const double surface_grey = light.grey_per_cd_m2 * light.room_cd_m2 * random.Uniform(0.2, 0.8) *
                              LogUniform(&random, 0.4, 5);
  const double lamp_cd_m2 = LogUniform(&random, 60, 4000);
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
    const double radius_px = LogUniform(&random, 2.5, small ? 8 : 25);
    thing.half_px = {radius_px, radius_px * random.Uniform(0.7, 1)};
    thing.round = thing.glows = true;
  }
  return thing;
}

// Distance from its nearest edge, positive inside; of an ellipse to first order.
double InsidePx(const Thing& thing, const Eigen::Vector2d& local) {
  if (!thing.round) return (thing.half_px - local.cwiseAbs()).minCoeff();
  const Eigen::Array2d scaled = local.array() / thing.half_px.array();
  const double radius = scaled.matrix().norm();
  if (radius < 1e-9) return thing.half_px.minCoeff();
  const double slope = (scaled / thing.half_px.array()).matrix().norm() / radius;
  return (1 - radius) / slope;
}

double Grain(const Thing& thing, const Eigen::Vector2d& local) {
  if (!(thing.grain_px > 0)) return 1;
  const double bent =
      local.y() + thing.grain_bend * local.x() * local.x() + 2 * std::sin(0.05 * local.x());
  const double ring = std::sin(2 * std::numbers::pi * bent / thing.grain_px);
  return 0.72 + 0.2 * ring + 0.08 * std::sin(3.1 * ring + 0.3 * local.y());
}

class RoomPainter {
 public:
  RoomPainter(const ImageSize& image_size, const FrameRenderOptions& options,
              const LightModel& light, const EdgeProfile& profile)
      : size_(image_size), options_(options), light_(light), profile_(profile) {
    grey_.resize(size_t{3} * image_size.width * image_size.height);
  }

  void PaintWall() {
    RandomStream random{options_.seed, kRoomPurpose};
    constexpr size_t kWaves = 5;
    Eigen::Vector3d waves[kWaves];
    for (Eigen::Vector3d& wave : waves) {
      wave = {random.Gaussian(), random.Gaussian(), random.Uniform(0, 2 * std::numbers::pi)};
    }
    const double turn = 5.0 / size_.width;
    const Bgr tint = HueColour(random.Uniform(0, 360), 0.06);
    const double grey = light_.grey_per_cd_m2 * light_.room_cd_m2 * options_.background_reflectance;
    float* out = grey_.data();
    for (uint32_t y = 0; y < size_.height; ++y) {
      for (uint32_t x = 0; x < size_.width; ++x) {
        double sum = 0;
        for (const Eigen::Vector3d& wave : waves) {
          sum += std::sin(turn * (wave.x() * x + wave.y() * y) + wave.z());
        }
        for (const double channel : tint) {
          *out++ = static_cast<float>(grey * channel * (1 + 0.08 * sum));
        }
      }
    }
  }

  void PaintThings() {
    const int count = static_cast<int>(std::lround(kThingsAtOne * options_.clutter));
    for (int i = 0; i < count; ++i) {
      Paint(DrawThing(size_, light_,
                      RandomStream{options_.seed, kRoomPurpose, static_cast<uint64_t>(i + 1)}));
    }
  }

  std::vector<int16_t> Linear() const {
    std::vector<int16_t> linear(grey_.size());
    size_t i = 0;
    for (uint32_t y = 0; y < size_.height; ++y) {
      for (uint32_t x = 0; x < size_.width; ++x) {
        const double passed = VignettingAt(size_, options_.vignetting, x, y);
        for (int channel = 0; channel < 3; ++channel, ++i) {
          linear[i] = ToLinear(options_.black_grey + passed * static_cast<double>(grey_[i]));
        }
      }
    }
    return linear;
  }

 private:
  void Paint(const Thing& thing) {
    const bool halo = thing.glows && options_.bloom > 0;
    const double reach = thing.half_px.norm() + static_cast<double>(profile_.reach_px()) +
                         (halo ? kLampHaloReach * options_.bloom_radius_px : 0);
    const auto first = [](double value) { return static_cast<int>(std::max(0.0, value)); };
    const auto last = [](double value, uint32_t side) {
      return static_cast<int>(std::min(value, side - 1.0));
    };
    for (int y = first(thing.centre_px.y() - reach);
         y <= last(thing.centre_px.y() + reach, size_.height); ++y) {
      for (int x = first(thing.centre_px.x() - reach);
           x <= last(thing.centre_px.x() + reach, size_.width); ++x) {
        const Eigen::Vector2d away = Eigen::Vector2d(x, y) - thing.centre_px;
        const Eigen::Vector2d local(away.dot(thing.axis),
                                    away.y() * thing.axis.x() - away.x() * thing.axis.y());
        const double inside_px = InsidePx(thing, local);
        const auto cover = static_cast<double>(profile_.At(static_cast<float>(inside_px)));
        const double glow =
            halo ? options_.bloom * std::exp(std::min(0.0, inside_px) / options_.bloom_radius_px)
                 : 0;
        if (cover <= 0 && glow <= 0) continue;
        const double light = cover * Grain(thing, local) + glow;
        float* pixel = &grey_[3 * (static_cast<size_t>(y) * size_.width + static_cast<size_t>(x))];
        for (size_t channel = 0; channel < 3; ++channel) {
          const double before = static_cast<double>(pixel[channel]);
          pixel[channel] =
              static_cast<float>((1 - cover) * before + light * thing.bgr_grey[channel]);
        }
      }
    }
  }

  const ImageSize size_;
  const FrameRenderOptions& options_;
  const LightModel& light_;
  const EdgeProfile& profile_;
  std::vector<float> grey_;
};

}  // namespace

double VignettingAt(const ImageSize& image_size, double vignetting, double x_px, double y_px) {
  const double half_x = 0.5 * image_size.width, half_y = 0.5 * image_size.height;
  const double x = x_px - half_x, y = y_px - half_y;
  return 1 - vignetting * std::min(1.0, (x * x + y * y) / (half_x * half_x + half_y * half_y));
}

std::vector<int16_t> RenderRoom(const ImageSize& image_size, const FrameRenderOptions& options,
                                const LightModel& light, const EdgeProfile& profile) {
  RoomPainter painter(image_size, options, light, profile);
  painter.PaintWall();
  painter.PaintThings();
  return painter.Linear();
}

}  // namespace rigcal
