// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "agent/detect/frame/wand_detector.h"

namespace rigcal::agent {

// Returns a colour copy of the image with the detection drawn in: the searched window (blue, none
// if empty), the ellipse of each blob (yellow), the markers with their numbers and the line through
// them (green), and outcome, confidence and counts as text. It leaves out what lies far outside of
// the image or is not finite. An empty image gives an empty copy.
cv::Mat Annotate(const ImageView& image, const Detection& detection, const PixelRect& window = {},
                 absl::Span<const Blob> blobs = {});

struct JpegImage {
  std::string bytes;
  int width = 0;  // pixels; fewer than the image's if it had to shrink
  int height = 0;
};

// Encodes an image in at most `max_bytes`: it lowers the quality first, then the resolution.
//    INVALID_ARGUMENT    the image is empty, or not of 8 bits with 1 or 3 channels
//    RESOURCE_EXHAUSTED  even the smallest version is larger
absl::StatusOr<JpegImage> EncodeJpeg(const cv::Mat& image, size_t max_bytes);

}  // namespace rigcal::agent
