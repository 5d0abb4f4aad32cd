// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/camera/camera_description.h"
#include "common/camera/intrinsics.h"

namespace rigcal::agent {

// Rays of a lens by pixel, from a table of every 32nd pixel (of large images fewer) of the image
// and a little beyond: where the lens has a ray all around, within 1e-4 px of the exact one.
// Elsewhere the exact one.
class RayTable {
 public:
  // The intrinsics must be valid.
  RayTable(const Intrinsics& intrinsics, const ImageSize& image_size_px);

  // The ray of a pixel, normalised coordinates, and how its pixel changes with it, 2x3 by the point
  // (x, y, 1) in frame `cam`. False where the lens has none.
  bool RayOf(const Eigen::Vector2d& pixel, Eigen::Vector2d* normalised,
             Eigen::Matrix<double, 2, 3>* d_pixel_d_point) const;
  // The lens has a ray there.
  bool HasRay(const Eigen::Vector2d& pixel) const;

 private:
  // The node left of and above a pixel, all of whose cell's corners have rays; -1: none.
  int CellOf(const Eigen::Vector2d& pixel, Eigen::Vector2d* share) const;

  Intrinsics intrinsics_;
  int cell_px_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<Eigen::Vector2d> nodes_;  // normalised coordinates, row by row
  std::vector<bool> is_inside_;         // by node: the cell right of and below it has rays
};

}  // namespace rigcal::agent
