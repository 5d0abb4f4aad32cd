// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/burst_shape.h"

#include <Eigen/LU>
#include <algorithm>
#include <climits>
#include <cmath>
#include <numbers>

namespace rigcal::agent {
namespace {

// Ratio of second moments that one marker does not have: a disc that moves by its radius has 1.3.
constexpr double kLongRatio = 1.6;
constexpr double kMarginPx = 1;  // outside the ellipse
constexpr int kMaxRounds = 5;    // what is taken out makes the ellipse smaller
constexpr double kMaxStrayShare = 1.0 / 3;
// Of a pixel's eight neighbours: a lit one with fewer beside it is noise that hangs on; an unlit
// one with more is a pixel that noise had put in reset.
constexpr int kMinBeside = 3, kHoleBeside = 6;

}  // namespace

PixelRect BoxOf(const PixelList& pixels) {
  int min_x = INT_MAX, max_x = -1, min_y = INT_MAX, max_y = -1;
  for (const auto& [x, y] : pixels) {
    min_x = std::min(min_x, x), max_x = std::max(max_x, x);
    min_y = std::min(min_y, y), max_y = std::max(max_y, y);
  }
  return {min_x, min_y, max_x - min_x + 1, max_y - min_y + 1};
}

bool TouchesBorder(const PixelRect& box, const SensorGeometry& geometry) {
  return box.x == 0 || box.y == 0 || box.x + box.width == static_cast<int>(geometry.width) ||
         box.y + box.height == static_cast<int>(geometry.height);
}

void Smooth(PixelList* pixels) {
  if (pixels->empty()) return;
  // A frame of pixels outside saves every look at a border.
  const PixelRect box = BoxOf(*pixels);
  const int width = box.width + 2;
  std::vector<uint8_t> lit(static_cast<size_t>(width) * static_cast<size_t>(box.height + 2), 0);
  const auto at = [&](int x, int y) { return (y - box.y + 1) * width + x - box.x + 1; };
  for (const auto& [x, y] : *pixels) lit[static_cast<size_t>(at(x, y))] = 1;
  const auto lit_beside = [&](int x, int y) {
    int count = -lit[static_cast<size_t>(at(x, y))];
    for (int v = y - 1; v <= y + 1; ++v) {
      for (int u = x - 1; u <= x + 1; ++u) count += lit[static_cast<size_t>(at(u, v))];
    }
    return count;
  };
  PixelList smoothed;
  for (const auto& [x, y] : *pixels) {
    if (lit_beside(x, y) >= kMinBeside) smoothed.emplace_back(x, y);
  }
  for (int y = box.y; y < box.y + box.height; ++y) {
    for (int x = box.x; x < box.x + box.width; ++x) {
      if (lit[static_cast<size_t>(at(x, y))] == 0 && lit_beside(x, y) >= kHoleBeside) {
        smoothed.emplace_back(x, y);
      }
    }
  }
  std::swap(*pixels, smoothed);
}

double RadiusPx(const Blob& shape) { return std::sqrt(shape.area_px / std::numbers::pi); }

bool IsLong(const Blob& shape) {
  const Eigen::Matrix2d& second = shape.second_moment_px2;
  const double mean = 0.5 * second.trace();
  const double apart =
      std::sqrt(0.25 * std::pow(second(0, 0) - second(1, 1), 2) + second(0, 1) * second(0, 1));
  return mean + apart > kLongRatio * (mean - apart);
}

Blob ShapeOf(const PixelList& pixels) {
  double sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
  const auto [x0, y0] = pixels.front();
  for (const auto& [x, y] : pixels) {
    const double dx = x - x0, dy = y - y0;
    sx += dx, sy += dy;
    sxx += dx * dx, sxy += dx * dy, syy += dy * dy;
  }
  const auto count = static_cast<double>(pixels.size());
  const double mx = sx / count, my = sy / count;
  Blob shape;
  shape.centre_px = {x0 + mx, y0 + my};
  shape.second_moment_px2 << sxx / count - mx * mx, sxy / count - mx * my, sxy / count - mx * my,
      syy / count - my * my;
  shape.area_px = static_cast<int>(pixels.size());
  shape.box = BoxOf(pixels);
  return shape;
}

Blob MarkerShapeOf(PixelList* pixels) {
  const Blob whole = ShapeOf(*pixels);
  const auto least = (1 - kMaxStrayShare) * whole.area_px;
  Blob shape = whole;
  PixelList kept = *pixels;
  for (int round = 0; round < kMaxRounds; ++round) {
    // A pixel has an extent of its own; a row of pixels has an inverse, too.
    const Eigen::Matrix2d extent = shape.second_moment_px2 + Eigen::Matrix2d::Identity() / 12;
    const Eigen::Matrix2d inverse = extent.inverse();
    // An ellipse ends at twice the root of its second moment.
    const double limit = 4 * std::pow(1 + kMarginPx / RadiusPx(shape), 2);
    const auto taken_out = std::erase_if(kept, [&](const auto& pixel) {
      const Eigen::Vector2d d = Eigen::Vector2d(pixel.first, pixel.second) - shape.centre_px;
      return d.dot(inverse * d) > limit;
    });
    if (taken_out == 0) break;
    if (static_cast<double>(kept.size()) < least) return whole;
    shape = ShapeOf(kept);
  }
  std::swap(*pixels, kept);
  return shape;
}

}  // namespace rigcal::agent
