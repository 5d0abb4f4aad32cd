// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "absl/container/inlined_vector.h"
#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// Predicts where a followed wand will be, from the velocity of its markers in the image and their
// last size. Forgets it on a new clock epoch, a step backwards in time and a long pause.
class WandTrack {
 public:
  using Points = absl::InlinedVector<Eigen::Vector2d, 3>;

  void Forget() { *this = WandTrack(); }
  // Adds the wand as it was seen: markers in the target's order, and the largest one's radius.
  void Add(int64_t time_ns, uint32_t clock_epoch, const Points& centres_px, double radius_px);

  // Returns the window to search; none: the whole image.
  std::optional<PixelRect> Window(int64_t time_ns, uint32_t clock_epoch,
                                  const PixelRect& bounds) const;
  // Velocity of a marker between its last two places, px/s; none: not followed long enough.
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
