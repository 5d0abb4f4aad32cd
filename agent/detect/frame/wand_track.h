// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "absl/container/inlined_vector.h"
#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// Predicts where a followed wand will be: constant velocity of its markers in the image, their size
// as last seen. Forgets on a new clock epoch, a step backwards and a pause.
class WandTrack {
 public:
  using Points = absl::InlinedVector<Eigen::Vector2d, 3>;

  void Forget() { *this = WandTrack(); }
  // The wand as it was seen, markers in the target's order; `radius_px` of the largest.
  void Add(int64_t time_ns, uint32_t clock_epoch, const Points& centres_px, double radius_px);

  // The window to search; none: all of the image.
  std::optional<PixelRect> Window(int64_t time_ns, uint32_t clock_epoch,
                                  const PixelRect& bounds) const;
  // Image velocity of marker `k` between its last two places, px/s; none: not followed long enough.
  std::optional<Eigen::Vector2d> Velocity(size_t marker) const;

 private:
  struct Sighting {
    int64_t time_ns = 0;
    Points centres_px;
  };
  uint32_t clock_epoch_ = 0;
  std::optional<Sighting> last_, before_;
  double radius_px_ = 0;
};

}  // namespace rigcal::agent
