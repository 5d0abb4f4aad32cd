// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/room_painter.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "common/simulation/frames/sensor_noise.h"
#include "common/simulation/world/random_stream.h"

namespace rigcal {
namespace {

constexpr uint64_t kWallPurpose = 0x726f6f6d;
constexpr double kShapeHaloReach = 5;  // radii of the halo

// Distance from its nearest edge, positive inside; of an ellipse to first order.
double InsidePx(const RoomShape& shape, const Eigen::Vector2d& local) {
  if (!shape.round) return (shape.half_px - local.cwiseAbs()).minCoeff();
  const Eigen::Array2d scaled = local.array() / shape.half_px.array();
  const double radius = scaled.matrix().norm();
  if (radius < 1e-9) return shape.half_px.minCoeff();
  const double slope = (scaled / shape.half_px.array()).matrix().norm() / radius;
  return (1 - radius) / slope;
}

// Relative brightness at a place of the shape.
double Texture(const RoomShape& shape, const Eigen::Vector2d& local) {
  double light = 1;
  if (shape.grain_px > 0) {
    const double bent =
        local.y() + shape.grain_bend * local.x() * local.x() + 2 * std::sin(0.05 * local.x());
    const double ring = std::sin(2 * std::numbers::pi * bent / shape.grain_px);
    light = 0.72 + 0.2 * ring + 0.08 * std::sin(3.1 * ring + 0.3 * local.y());
  }
  if (shape.cloth > 0) {
    const Eigen::Array2d at = local.array() / shape.half_px.array();
    light *= 1 + shape.cloth * std::sin(5 * at.x() + 3 * std::sin(2.3 * at.y())) *
                     std::cos(2.1 * at.y() + 0.7 * at.x());
  }
  if (shape.shade.squaredNorm() > 0) {
    const Eigen::Array2d at = (local.array() / shape.half_px.array()).max(-1.0).min(1.0);
    light *= 1 + (at * shape.shade.array()).sum();
  }
  return std::max(0.0, light);
}

}  // namespace

double VignettingAt(const ImageSize& image_size, double vignetting, double x_px, double y_px) {
  const double half_x = 0.5 * image_size.width, half_y = 0.5 * image_size.height;
  const double x = x_px - half_x, y = y_px - half_y;
  return 1 - vignetting * std::min(1.0, (x * x + y * y) / (half_x * half_x + half_y * half_y));
}

RoomPainter::RoomPainter(const ImageSize& image_size, const FrameRenderOptions& options,
                         const LightModel& light, const EdgeProfile& profile)
    : size_(image_size),
      options_(options),
      light_(light),
      profile_(profile),
      grey_(size_t{3} * image_size.width * image_size.height) {}

void RoomPainter::PaintWall() {
  RandomStream random{options_.seed, kWallPurpose};
  constexpr size_t kWaves = 5;
  Eigen::Vector3d waves[kWaves];
  for (Eigen::Vector3d& wave : waves) {
    wave = {random.Gaussian(), random.Gaussian(), random.Uniform(0, 2 * std::numbers::pi)};
  }
  const double turn = 5.0 / size_.width;
  const Bgr tint = HueColour(random.Uniform(0, 360), 0.06);
  const double grey = surface_grey() * options_.background_reflectance;
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

void RoomPainter::PaintPhotograph(const std::vector<float>& bgr) {
  const auto grey = static_cast<float>(surface_grey());
  for (size_t i = 0; i < std::min(bgr.size(), grey_.size()); ++i) grey_[i] = grey * bgr[i];
}

void RoomPainter::Paint(const RoomShape& shape) {
  const bool halo = shape.glows && options_.bloom > 0;
  const double reach = shape.half_px.norm() + static_cast<double>(profile_.reach_px()) +
                       (halo ? kShapeHaloReach * options_.bloom_radius_px : 0);
  const auto first = [](double value) { return static_cast<int>(std::max(0.0, value)); };
  const auto last = [](double value, uint32_t side) {
    return static_cast<int>(std::min(value, side - 1.0));
  };
  for (int y = first(shape.centre_px.y() - reach);
       y <= last(shape.centre_px.y() + reach, size_.height); ++y) {
    for (int x = first(shape.centre_px.x() - reach);
         x <= last(shape.centre_px.x() + reach, size_.width); ++x) {
      const Eigen::Vector2d away = Eigen::Vector2d(x, y) - shape.centre_px;
      const Eigen::Vector2d local(away.dot(shape.axis),
                                  away.y() * shape.axis.x() - away.x() * shape.axis.y());
      const double inside_px = InsidePx(shape, local);
      const auto cover = static_cast<double>(profile_.At(static_cast<float>(inside_px)));
      const double glow =
          halo ? options_.bloom * std::exp(std::min(0.0, inside_px) / options_.bloom_radius_px) : 0;
      if (cover <= 0 && glow <= 0) continue;
      const double light = cover * Texture(shape, local) + glow;
      float* pixel = &grey_[3 * (static_cast<size_t>(y) * size_.width + static_cast<size_t>(x))];
      for (size_t channel = 0; channel < 3; ++channel) {
        const double before = static_cast<double>(pixel[channel]);
        pixel[channel] = static_cast<float>((1 - cover) * before + light * shape.bgr_grey[channel]);
      }
    }
  }
}

std::vector<int16_t> RoomPainter::Linear() const {
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

}  // namespace rigcal
