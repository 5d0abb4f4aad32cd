// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "agent/detect/blobs/image_view.h"
#include "agent/identify/marker_aperture.h"

namespace rigcal::agent {

// Returns the grey levels of a pixel by channel; those that a mono image lacks are 0.
inline Eigen::Vector3f GreyAt(const ImageView& image, int x, int y) {
  const uint8_t* row = image.Row(y);
  if (image.format == PixelFormat::kMono8) return {static_cast<float>(row[x]), 0, 0};
  const uint8_t* pixel = row + 3 * x;
  return {static_cast<float>(pixel[0]), static_cast<float>(pixel[1]), static_cast<float>(pixel[2])};
}

// Returns the sum of squares of a pixel's grey levels.
inline int SquaredGreyAt(const ImageView& image, int x, int y) {
  const bool is_mono = image.format == PixelFormat::kMono8;
  const uint8_t* const pixel = image.Row(y) + (is_mono ? x : 3 * x);
  int sum = int{pixel[0]} * pixel[0];
  if (!is_mono) sum += int{pixel[1]} * pixel[1] + int{pixel[2]} * pixel[2];
  return sum;
}

// A window of which every `step`-th pixel of every `step`-th row is read.
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

// Consecutive pixels of a row of a grid.
struct GridRow {
  size_t number;  // of the first pixel, in the grid
  int x, y;       // of the first pixel
  int count;
};

// The chord of the ellipse d^T shape d <= 1 in the row `dy` below its centre.
struct EllipseChord {
  EllipseChord(const Eigen::Matrix2d& shape, double dy)
      : half_squared((shape(0, 0) - shape.determinant() * dy * dy) / (shape(0, 0) * shape(0, 0))),
        half(std::sqrt(std::max(0.0, half_squared))),
        middle(-shape(0, 1) / shape(0, 0) * dy) {}

  double half_squared;  // square of `half`; negative: the row passes the ellipse
  double half;          // half of its length
  double middle;        // its middle, from the ellipse's centre
};

// Calls visit(row) for the pixels of each row of the grid in the ellipse d^T shape d <= 1 about
// `centre_px`, and for a few right beside it.
template <typename Visit>
void ForEllipseRows(const PixelGrid& grid, const Eigen::Vector2d& centre_px,
                    const Eigen::Matrix2d& shape, Visit visit) {
  const PixelRect& window = grid.rect;
  const int columns = (window.width + grid.step - 1) / grid.step;
  const double per_step = 1.0 / grid.step;
  size_t row = 0;
  for (int y = window.y; y < window.y + window.height; y += grid.step) {
    const size_t before = row;
    row += static_cast<size_t>(columns);
    const EllipseChord chord(shape, y - centre_px.y());
    if (!(chord.half_squared > -1)) continue;
    const double middle = centre_px.x() + chord.middle - window.x;
    const int first = std::max(0, static_cast<int>((middle - chord.half) * per_step) - 1);
    const int last = std::min(columns - 1, static_cast<int>((middle + chord.half) * per_step) + 1);
    if (first > last) continue;
    visit(GridRow{before + static_cast<size_t>(first), window.x + first * grid.step, y,
                  last - first + 1});
  }
}

// Calls visit(number, x, y, offset from `centre_px`) for each of these pixels, row by row.
template <typename Visit>
void ForEllipse(const PixelGrid& grid, const Eigen::Vector2d& centre_px,
                const Eigen::Matrix2d& shape, Visit visit) {
  ForEllipseRows(grid, centre_px, shape, [&](const GridRow& row) {
    int x = row.x;
    for (int i = 0; i < row.count; ++i, x += grid.step) {
      visit(row.number + static_cast<size_t>(i), x, row.y,
            Eigen::Vector2d(x - centre_px.x(), row.y - centre_px.y()));
    }
  });
}

// The background around a marker: medians over short arcs of a ring, so that patches of different
// colours may lie behind the marker. Buffers are kept; one thread at a time.
class RingBackground {
 public:
  struct Arc {
    Eigen::Vector3f background = Eigen::Vector3f::Zero();  // grey levels by channel
    int pixels = 0;
    bool blocked = false;  // something else is near, here or on the opposite side
  };

  // The ring in which the background is read.
  struct Ring {
    double from_px;  // gap between the aperture's ellipse and the ring
    double width_px;
    double arc_px;  // length of an arc
  };

  // Reads the part of the ring that lies in `window`, without pixels that look like the marker.
  // `noise_grey` (may be null): one sigma of one pixel and channel. False: too few pixels.
  bool Read(const ImageView& image, const MarkerAperture& aperture, const PixelGrid& window,
            const Eigen::Vector3f& plateau_grey, const Ring& ring, double* noise_grey);

  // Writes the directions of a row's pixels, from 0 to the number of arcs. `offset` is the first
  // pixel's from the aperture's centre, `step` the distance between pixels.
  void TurnsOf(const Eigen::Vector2d& offset, int step, int count, std::vector<float>* turns) const;

  // Like ForEllipse: visit(number, x, y, offset, direction). `turns` is a buffer.
  template <typename Visit>
  void ForDirections(const PixelGrid& grid, const Eigen::Vector2d& centre_px,
                     const Eigen::Matrix2d& shape, std::vector<float>* turns, Visit visit) const {
    ForEllipseRows(grid, centre_px, shape, [&](const GridRow& row) {
      Eigen::Vector2d d(row.x - centre_px.x(), row.y - centre_px.y());
      TurnsOf(d, grid.step, row.count, turns);
      for (int i = 0; i < row.count; ++i, d.x() += grid.step) {
        const auto at = static_cast<size_t>(i);
        visit(row.number + at, row.x + i * grid.step, row.y, d, (*turns)[at]);
      }
    });
  }

  // Returns the background behind a pixel in a direction (TurnsOf), interpolated between the two
  // arcs next to it. `arc` becomes the nearer of them.
  Eigen::Vector3f At(float direction, size_t* arc) const {
    const float turn = direction - 0.5f;
    const auto low = static_cast<int>(turn + 1) - 1;  // turn is -0.5 or more
    const float share = turn - static_cast<float>(low);
    const size_t first = low < 0 ? arcs_.size() - 1 : static_cast<size_t>(low);
    const size_t second = first + 1 < arcs_.size() ? first + 1 : 0;
    *arc = share < 0.5f ? first : second;
    return (1 - share) * arcs_[first].background + share * arcs_[second].background;
  }

  // The arcs of the last Read in the order of their directions; each has an opposite one.
  std::vector<Arc>& arcs() { return arcs_; }
  const std::vector<Arc>& arcs() const { return arcs_; }

 private:
  struct RingPixel {
    float turn;  // its direction, 0 to the number of arcs
    std::array<uint8_t, 3> grey;
  };

  // Calls visit(arc) for the arc of a pixel and for the neighbour that the pixel also counts for.
  template <typename Visit>
  void ForArcsOf(const RingPixel& pixel, Visit visit) const;

  std::vector<Arc> arcs_;
  std::vector<RingPixel> pixels_;
  std::vector<float> turns_;                   // directions of a row's pixels
  std::vector<size_t> ends_;                   // of the arcs in greys_
  std::array<std::vector<uint8_t>, 3> greys_;  // by channel, arc after arc
};

}  // namespace rigcal::agent
