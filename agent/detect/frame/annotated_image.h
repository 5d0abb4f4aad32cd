// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "agent/detect/frame/wand_detector.h"

namespace rigcal::agent {

// A colour copy of the image with the detection drawn in: the searched window (blue), the ellipse
// of each blob (yellow), the markers with their numbers and the line through them (green), and
// outcome, confidence and counts as text. `window` empty: the whole image. What lies far outside
// the image or is no number is left out. Empty for an empty image.
cv::Mat Annotate(const ImageView& image, const Detection& detection, const PixelRect& window = {},
                 absl::Span<const Blob> blobs = {});

struct JpegImage {
  std::string bytes;
  int width = 0;  // pixels; less than the image's where it had to shrink
  int height = 0;
};

// Of at most `max_bytes`: with less quality first, then with fewer pixels.
//   INVALID_ARGUMENT    the image is empty, or not of 8 bits with 1 or 3 channels
//   RESOURCE_EXHAUSTED  no image of that kind is so small
absl::StatusOr<JpegImage> EncodeJpeg(const cv::Mat& image, size_t max_bytes);

}  // namespace rigcal::agent
