// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/camera/camera_description.h"
#include "common/camera/intrinsics.h"

namespace rigcal::agent {

// Rays of a lens by pixel, from a table of every 32nd pixel (in large images fewer) of the image
// and a little beyond. They are within 1e-4 px of the exact ones. Where a cell of the table has a
// corner without a ray, the exact ray is computed.
class RayTable {
 public:
  // The intrinsics must be valid.
  RayTable(const Intrinsics& intrinsics, const ImageSize& image_size_px);

  // Returns the ray of a pixel in normalised coordinates, and the derivative of its pixel by the
  // point (x, y, 1) in frame `cam`, 2x3. False if the lens has no ray there.
  bool RayOf(const Eigen::Vector2d& pixel, Eigen::Vector2d* normalised,
             Eigen::Matrix<double, 2, 3>* d_pixel_d_point) const;
  // Tells whether the lens has a ray there.
  bool HasRay(const Eigen::Vector2d& pixel) const;

 private:
  // Returns the node at the upper left of a pixel's cell if all its corners have rays, else -1.
  int CellOf(const Eigen::Vector2d& pixel, Eigen::Vector2d* share) const;

  Intrinsics intrinsics_;
  int cell_px_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<Eigen::Vector2d> nodes_;  // normalised coordinates, row by row
  std::vector<bool> is_inside_;  // by node: all corners of the cell right of and below it have rays
};

}  // namespace rigcal::agent
