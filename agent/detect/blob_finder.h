// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "agent/detect/colour_range.h"
#include "agent/detect/image_view.h"

namespace rigcal::agent {

// Connected pixels (8 neighbours) of one mask, each with weight 1.
struct Blob {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();          // mean of the pixels, img frame
  Eigen::Matrix2d second_moment_px2 = Eigen::Matrix2d::Zero();  // about that mean
  int area_px = 0;
  PixelRect box;
  bool touches_border = false;  // of the picture, not of the window
};

struct BlobFinderOptions {
  ColourRange colour;
  int min_area_px = 6;
  int max_area_px = 20000;
  int max_blobs = 512;  // more are counted, not kept: the largest ones stay

  // Every fault.
  absl::Status Validate() const;
};

struct BlobResult {
  std::vector<Blob> blobs;  // from top to bottom, left to right by their first pixel
  int too_small = 0;
  int too_large = 0;
  int over_limit = 0;       // in area range, but beyond max_blobs
  int64_t mask_pixels = 0;  // taken by the colour range
};

}  // namespace rigcal::agent
