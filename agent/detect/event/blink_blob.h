// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// A marker in one burst of light.
struct BlinkBlob {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second_moment_px2 = Eigen::Matrix2d::Zero();  // about the centre
  int area_px = 0;                                              // pixels that lit up in this burst
  double time_us = 0;    // the sensor's clock, lower 32 bits: when the marker was at the centre
  double period_us = 0;  // between the last two bursts, mean over the pixels
  int frequency = 0;     // which of BlinkFilterOptions::blink_hz that is
  PixelRect box;
  bool touches_border = false;
};

}  // namespace rigcal::agent
