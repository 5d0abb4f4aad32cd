// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "agent/detect/blobs/image_view.h"
#include "agent/identify/marker_aperture.h"

namespace rigcal::agent {

// The channels of a pixel; of an image with one, the others are 0.
inline Eigen::Vector3f GreyAt(const ImageView& image, int x, int y) {
  const uint8_t* row = image.Row(y);
  if (image.format == PixelFormat::kMono8) return {static_cast<float>(row[x]), 0, 0};
  const uint8_t* pixel = row + 3 * x;
  return {static_cast<float>(pixel[0]), static_cast<float>(pixel[1]), static_cast<float>(pixel[2])};
}

// Of the same, the sum of squares.
inline int SquaredGreyAt(const ImageView& image, int x, int y) {
  const bool is_mono = image.format == PixelFormat::kMono8;
  const uint8_t* const pixel = image.Row(y) + (is_mono ? x : 3 * x);
  int sum = int{pixel[0]} * pixel[0];
  if (!is_mono) sum += int{pixel[1]} * pixel[1] + int{pixel[2]} * pixel[2];
  return sum;
}

// A window, of which every `step`-th pixel of every `step`-th row is looked at.
struct PixelGrid {
  PixelRect rect;
  int step = 1;

  size_t size() const {
    const auto count = [this](int extent) {
      return static_cast<size_t>((extent + step - 1) / step);
    };
    return count(rect.width) * count(rect.height);
  }
};

// Without white: what is left of grey levels by channel.
inline Eigen::Vector3f ColourOf(const Eigen::Vector3f& grey) { return grey.array() - grey.mean(); }

// Calls visit(number, x, y, offset from `centre_px`) for every pixel of the grid in the ellipse
// d^T shape d <= 1 about `centre_px`, and for a few right beside it, row by row.
template <typename Visit>
void ForEllipse(const PixelGrid& grid, const Eigen::Vector2d& centre_px,
                const Eigen::Matrix2d& shape, Visit visit) {
  const PixelRect& window = grid.rect;
  const int columns = (window.width + grid.step - 1) / grid.step;
  const double per_a = 1 / shape(0, 0), per_step = 1.0 / grid.step;
  const double determinant = shape.determinant();
  size_t row = 0;
  for (int y = window.y; y < window.y + window.height; y += grid.step) {
    const double dy = y - centre_px.y();
    const size_t before = row;
    row += static_cast<size_t>(columns);
    const double squared = (shape(0, 0) - determinant * dy * dy) * per_a * per_a;
    if (!(squared > -1)) continue;
    const double half = std::sqrt(std::max(0.0, squared));
    const double middle = centre_px.x() - shape(0, 1) * per_a * dy - window.x;
    const int first = std::max(0, static_cast<int>((middle - half) * per_step) - 1);
    const int last = std::min(columns - 1, static_cast<int>((middle + half) * per_step) + 1);
    int x = window.x + first * grid.step;
    for (int i = first; i <= last; ++i, x += grid.step) {
      visit(before + static_cast<size_t>(i), x, y, Eigen::Vector2d(x - centre_px.x(), dy));
    }
  }
}

// The background around a marker: medians over short arcs of a ring, so that patches of different
// colours may lie behind. Buffers are kept; one thread at a time.
class RingBackground {
 public:
  struct Arc {
    Eigen::Vector3f background = Eigen::Vector3f::Zero();
    int pixels = 0;
    bool blocked = false;  // something else is near, here or on the opposite side
  };

  // Where it is read, in pixels.
  struct Ring {
    double from_px;  // outside of the aperture's ellipse
    double width_px;
    double arc_px;  // length of an arc
  };

  // Reads the part of the ring that lies in `window`, without what looks like the marker.
  // `noise_grey`: one sigma of one pixel and channel; may be null. False: too few pixels.
  bool Read(const ImageView& image, const MarkerAperture& aperture, const PixelGrid& window,
            const Eigen::Vector3f& plateau_grey, const Ring& ring, double* noise_grey);

  // The background behind a pixel, between the two arcs next to its direction, and the nearer of
  // them. `offset`: of the pixel from the aperture's centre.
  Eigen::Vector3f At(const Eigen::Vector2d& offset, size_t* arc) const {
    const float turn = TurnOf(offset, static_cast<float>(arcs_.size())) - 0.5f;
    const auto low = static_cast<int>(turn + 1) - 1;  // turn is -0.5 or more
    const float share = turn - static_cast<float>(low);
    const size_t first = low < 0 ? arcs_.size() - 1 : static_cast<size_t>(low);
    const size_t second = first + 1 < arcs_.size() ? first + 1 : 0;
    *arc = share < 0.5f ? first : second;
    return (1 - share) * arcs_[first].background + share * arcs_[second].background;
  }

  // How much the background changes from arc `k` to its neighbours, by channel; less than twice
  // `noise_grey` is none.
  Eigen::Vector3f StepAt(size_t k, float noise_grey) const {
    const Eigen::Array3f own = arcs_[k].background;
    const Eigen::Array3f before = arcs_[k > 0 ? k - 1 : arcs_.size() - 1].background;
    const Eigen::Array3f after = arcs_[k + 1 < arcs_.size() ? k + 1 : 0].background;
    const Eigen::Array3f step = (before - own).abs().max((after - own).abs());
    return (step - 2 * noise_grey).max(0.0f);
  }

  // After Read, in the order of their direction, an even number.
  std::vector<Arc>& arcs() { return arcs_; }
  const std::vector<Arc>& arcs() const { return arcs_; }

 private:
  struct RingPixel {
    float turn;  // its direction, 0 to the number of arcs
    std::array<uint8_t, 3> grey;
  };

  // Direction of `d`, 0 to `turns`.
  static float TurnOf(const Eigen::Vector2d& d, float turns) {
    // atan to 1e-4 rad: arcs are a hundred times as long.
    const auto x = static_cast<float>(d.x()), y = static_cast<float>(d.y());
    const float ax = std::abs(x), ay = std::abs(y);
    const float low = std::min(ax, ay), high = std::max(ax, ay);
    const float t = high > 0 ? low / high : 0, t2 = t * t;
    float angle =
        t *
        (0.99997726f +
         t2 * (-0.33262347f +
               t2 * (0.19354346f + t2 * (-0.11643287f + t2 * (0.05265332f - t2 * 0.01172120f)))));
    constexpr auto kPi = std::numbers::pi_v<float>;
    if (ay > ax) angle = 0.5f * kPi - angle;
    if (x < 0) angle = kPi - angle;
    if (y < 0) angle = -angle;
    return std::clamp((angle / (2 * kPi) + 0.5f) * turns, 0.0f, turns);
  }

  // Calls visit(arc) for the arc of a pixel and the neighbour that it also counts for.
  template <typename Visit>
  void ForArcsOf(const RingPixel& pixel, Visit visit) const;

  std::vector<Arc> arcs_;
  std::vector<RingPixel> pixels_;
  std::vector<size_t> ends_;                   // of the arcs in greys_
  std::array<std::vector<uint8_t>, 3> greys_;  // of the pixels, by channel, arc after arc
};

}  // namespace rigcal::agent
