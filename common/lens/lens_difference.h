// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"

namespace rigcal {

// How far two lenses of one camera are apart, over a grid of pixels of the whole image.
struct LensDifference {
  static constexpr int kColumns = 30, kRows = 24;  // of the grid, from border to border
  static Eigen::Vector2d GridPixel(const ImageSize& image_size_px, int row, int column) {
    return {(image_size_px.width - 1.0) * column / (kColumns - 1),
            (image_size_px.height - 1.0) * row / (kRows - 1)};
  }
  double median_px = 0;
  double p95_px = 0;  // 95 % of the image differ by less
  double most_px = 0;
  // Of the grid, where one of the lenses has no ray, or the other one does not show it.
  double unknown_share = 0;
  double turned_deg = 0;       // the rotation that was taken out
  std::vector<double> map_px;  // row by row of the grid; not a number where it is unknown
};

// Pixel -> ray by lens `a` -> pixel by lens `b`, after the rotation that makes the distances least:
// a lens and the orientation of its camera cannot be told apart, and who uses the lens solves for
// the orientation. FAILED_PRECONDITION: they have less than a quarter of the image in common.
absl::StatusOr<LensDifference> CompareLenses(const Intrinsics& a, const Intrinsics& b,
                                             const ImageSize& image_size_px);

}  // namespace rigcal
