// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
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

// Calls visit(number, x, y, offset from `centre_px`) for every pixel of the grid, row by row.
template <typename Visit>
void ForPixels(const PixelGrid& grid, const Eigen::Vector2d& centre_px, Visit visit) {
  const PixelRect& window = grid.rect;
  size_t i = 0;
  for (int y = window.y; y < window.y + window.height; y += grid.step) {
    for (int x = window.x; x < window.x + window.width; x += grid.step, ++i) {
      visit(i, x, y, Eigen::Vector2d(x - centre_px.x(), y - centre_px.y()));
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
  Eigen::Vector3f At(const Eigen::Vector2d& offset, size_t* arc) const;

  // After Read, in the order of their direction, an even number.
  std::vector<Arc>& arcs() { return arcs_; }
  const std::vector<Arc>& arcs() const { return arcs_; }

 private:
  struct RingPixel {
    float turn;  // its direction, 0 to the number of arcs
    Eigen::Vector3f grey;
  };
  std::vector<Arc> arcs_;
  std::vector<RingPixel> pixels_;
  std::vector<std::vector<int>> by_arc_;  // pixels of each arc
  std::vector<float> values_;             // of one arc and channel
  std::vector<float> residuals_;
};

}  // namespace rigcal::agent
