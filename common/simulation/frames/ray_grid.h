// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"

namespace rigcal {

// The unit vector in frame `cam` along which each pixel looks, read from a grid of exact ones
// (every fourth pixel) with linear interpolation: right to some 0.001 px with the lenses of this
// project.
class RayGrid {
 public:
  // INVALID_ARGUMENT: no pixel of the image has a ray.
  static absl::StatusOr<RayGrid> Create(const Intrinsics& intrinsics, const ImageSize& image_size);

  // Rays of `count` pixels of row `y` from column `x` on, not normalised to better than 1e-5; NaN
  // where the lens has none. Row and columns must be within the image.
  void Row(int x, int y, int count, Eigen::Vector3d* rays) const;

 private:
  static constexpr int kStep = 4;
  int columns_ = 0;
  std::vector<Eigen::Vector3d> nodes_;
};

}  // namespace rigcal
