// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "agent/event/event.h"
#include "agent/event/event_words.h"

namespace rigcal::agent {

// Pictures of what moves, from the polarities of its events: the sum of a pixel's polarities p is
// how bright it has become, and two high passes take out what thresholds that differ add up to,
//   L_k = c0 L_(k-1) + c1 L_(k-2) + c2 (p_k - p_(k-1)),
// from event to event of the pixel, whatever the time between them (the reconstruction of Pfrommer
// 2022, "Frequency Cam"). So a disc is filled as soon as it has moved by its diameter, however
// slow.
class PolarityFilter {
 public:
  explicit PolarityFilter(SensorGeometry geometry);

  void Take(const PackedEvent& event) {
    Pixel& pixel = pixels_[static_cast<size_t>(event.y()) * width_ + event.x];
    const float polarity = event.on() ? 1.0f : -1.0f;
    const float level = kC0 * pixel.level + kC1 * pixel.before + kC2 * (polarity - pixel.polarity);
    pixel.before = pixel.level;
    pixel.level = level;
    pixel.polarity = polarity;
    pixel.time_us = event.time_us;
  }
  // CV_32FC1: how much brighter than for long. Of what had no event for half a second less is left.
  cv::Mat1f PictureAt(uint32_t time_us) const;
  void Clear();

 private:
  // Periods of 40 events and more are taken out: poles at 1 - 2 pi / 40 or so.
  static constexpr float kAlpha = 0.85f, kBeta = 0.85f;
  static constexpr float kC0 = kAlpha + kBeta, kC1 = -kAlpha * kBeta, kC2 = 0.5f * (1 + kBeta);
  struct Pixel {
    float level = 0, before = 0, polarity = 0;
    uint32_t time_us = 0;
  };
  size_t width_, height_;
  std::vector<Pixel> pixels_;
};

}  // namespace rigcal::agent
