// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event_board/polarity_filter.h"

#include <algorithm>
#include <cmath>

namespace rigcal::agent {
namespace {

constexpr double kForgetUs = 500'000;
constexpr double kForgottenUs = 2'000'000;

}  // namespace

PolarityFilter::PolarityFilter(SensorGeometry geometry)
    : width_(geometry.width), height_(geometry.height), pixels_(width_ * height_) {}

cv::Mat1f PolarityFilter::PictureAt(uint32_t time_us) const {
  cv::Mat1f picture(static_cast<int>(height_), static_cast<int>(width_));
  for (size_t y = 0; y < height_; ++y) {
    float* const row = picture.ptr<float>(static_cast<int>(y));
    for (size_t x = 0; x < width_; ++x) {
      const Pixel& pixel = pixels_[y * width_ + x];
      const double age_us = std::max(0, static_cast<int32_t>(time_us - pixel.time_us));
      const bool is_quiet = pixel.polarity == 0 || age_us > kForgottenUs;
      row[x] = is_quiet ? 0.0f : pixel.level * static_cast<float>(std::exp(-age_us / kForgetUs));
    }
  }
  return picture;
}

void PolarityFilter::Clear() { std::fill(pixels_.begin(), pixels_.end(), Pixel()); }

}  // namespace rigcal::agent
