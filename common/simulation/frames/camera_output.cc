// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/camera_output.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace rigcal {
namespace {

constexpr int kJpegBlock = 8;
// ITU-T T.81, tables K.1 and K.2.
constexpr int kLuminance[kJpegBlock * kJpegBlock] = {
    16, 11, 10, 16, 24,  40,  51,  61,  12, 12, 14, 19, 26,  58,  60,  55,  //
    14, 13, 16, 24, 40,  57,  69,  56,  14, 17, 22, 29, 51,  87,  80,  62,  //
    18, 22, 37, 56, 68,  109, 103, 77,  24, 35, 55, 64, 81,  104, 113, 92,  //
    49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99};
constexpr int kChrominance[kJpegBlock * kJpegBlock] = {
    17, 18, 24, 47, 99, 99, 99, 99, 18, 21, 26, 66, 99, 99, 99, 99,  //
    24, 26, 56, 99, 99, 99, 99, 99, 47, 66, 99, 99, 99, 99, 99, 99,  //
    99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99,  //
    99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99};

cv::Mat1f Steps(const int (&table)[kJpegBlock * kJpegBlock], int quality) {
  const int percent = quality < 50 ? 5000 / quality : 200 - 2 * quality;
  cv::Mat1f steps(kJpegBlock, kJpegBlock);
  for (int i = 0; i < kJpegBlock * kJpegBlock; ++i) {
    steps(i / kJpegBlock, i % kJpegBlock) =
        static_cast<float>(std::clamp((table[i] * percent + 50) / 100, 1, 255));
  }
  return steps;
}

// Of one plane, in place.
void Quantise(const cv::Mat1f& steps, cv::Mat1b* plane) {
  cv::Mat padded;
  const int bottom = (kJpegBlock - plane->rows % kJpegBlock) % kJpegBlock;
  const int right = (kJpegBlock - plane->cols % kJpegBlock) % kJpegBlock;
  cv::copyMakeBorder(*plane, padded, 0, bottom, 0, right, cv::BORDER_REPLICATE);
  cv::Mat1f values;
  padded.convertTo(values, CV_32F, 1, -128);
  cv::Mat1f block(kJpegBlock, kJpegBlock);
  for (int y = 0; y < values.rows; y += kJpegBlock) {
    for (int x = 0; x < values.cols; x += kJpegBlock) {
      cv::Mat1f part = values(cv::Rect(x, y, kJpegBlock, kJpegBlock));
      cv::dct(part, block);
      for (int i = 0; i < kJpegBlock * kJpegBlock; ++i) {
        float& value = block(i / kJpegBlock, i % kJpegBlock);
        const float step = steps(i / kJpegBlock, i % kJpegBlock);
        value = std::round(value / step) * step;
      }
      cv::idct(block, block);
      block.copyTo(part);
    }
  }
  values(cv::Rect(0, 0, plane->cols, plane->rows)).convertTo(*plane, CV_8U, 1, 128);
}

cv::Mat3b View(const ImageSize& size, std::span<uint8_t> bgr) {
  return {static_cast<int>(size.height), static_cast<int>(size.width),
          reinterpret_cast<cv::Vec3b*>(bgr.data())};
}

}  // namespace

void ApplyBayer(const ImageSize& image_size, std::span<uint8_t> bgr) {
  cv::Mat3b image = View(image_size, bgr);
  cv::Mat1b mosaic(image.size());
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      // Red at even rows and columns, blue at odd ones, green at the others.
      const int channel = y % 2 == x % 2 ? (y % 2 == 0 ? 2 : 0) : 1;
      mosaic(y, x) = image(y, x)[channel];
    }
  }
  // OpenCV names the pattern by its second row and column.
  cv::cvtColor(mosaic, image, cv::COLOR_BayerBG2BGR);
}

void ApplyJpegLoss(const ImageSize& image_size, int quality, std::span<uint8_t> bgr) {
  cv::Mat3b image = View(image_size, bgr);
  cv::Mat3b ycrcb;
  cv::cvtColor(image, ycrcb, cv::COLOR_BGR2YCrCb);
  std::vector<cv::Mat1b> planes(3);
  cv::split(ycrcb, planes);
  const cv::Mat1f coarse = Steps(kChrominance, quality);
  Quantise(Steps(kLuminance, quality), &planes[0]);
  for (size_t i = 1; i < 3; ++i) {
    cv::Mat1b half;
    cv::resize(planes[i], half, {(image.cols + 1) / 2, (image.rows + 1) / 2}, 0, 0, cv::INTER_AREA);
    Quantise(coarse, &half);
    cv::resize(half, planes[i], image.size(), 0, 0, cv::INTER_LINEAR);
  }
  cv::merge(planes, ycrcb);
  cv::cvtColor(ycrcb, image, cv::COLOR_YCrCb2BGR);
}

}  // namespace rigcal
