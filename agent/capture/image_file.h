// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// `image` is CV_8UC1 or CV_8UC3 (BGR) and outlives the view.
ImageView ViewOf(const cv::Mat& image);

// Bits of a pixel in an image that has room for 16.
inline constexpr int kMostBits = 16;

// CV_8UC1 or CV_8UC3 from a decoder's image: of pixels with room for 16 bits, of which `bits` are
// used, the upper eight are kept; alpha is dropped. INVALID_ARGUMENT: another depth or number of
// channels.
absl::StatusOr<cv::Mat> AsEightBit(const cv::Mat& image, int bits = kMostBits);

// True for the endings of image files (.png, .jpg, .bmp, .tif, ...) in any case.
bool IsImageName(std::string_view name);

// An image from a file, as it lies on the sensor (EXIF rotation is ignored), CV_8UC1 or CV_8UC3.
// NOT_FOUND: no such file. DATA_LOSS: it is empty, truncated, damaged or not an image. Both name
// it. `used_bits`, if not null: that the brightest of its pixels needs, of 16; 8 of an image of 8.
absl::StatusOr<cv::Mat> ReadImage(const std::string& path, int bits = kMostBits,
                                  int* used_bits = nullptr);

}  // namespace rigcal::agent
