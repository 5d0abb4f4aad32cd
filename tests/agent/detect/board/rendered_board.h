// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>

#include "agent/detect/blobs/image_view.h"
#include "common/simulation/frames/board_renderer.h"

namespace rigcal::testing {

using rigcal::BoardRenderer;

// Of a CV_8UC1.
inline agent::ImageView MonoView(const cv::Mat& image) {
  return {.data = image.data,
          .width = image.cols,
          .height = image.rows,
          .stride_bytes = static_cast<ptrdiff_t>(image.step),
          .format = agent::PixelFormat::kMono8};
}

}  // namespace rigcal::testing
