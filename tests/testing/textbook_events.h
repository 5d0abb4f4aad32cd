// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <opencv2/features2d.hpp>
#include <span>
#include <vector>

#include "agent/event/event.h"
#include "agent/event/event_decoder.h"

namespace rigcal::testing {

// Plain implementations after papers and manuals: oracles of the tests and references of the
// benchmarks.

// EVT 3.0 word by word (docs.prophesee.ai, "EVT 3.0 Format"), without any checks.
// `consume(x, y, on, time_us)` per event.
template <typename Consume>
void DecodeTextbookEvt3(std::span<const uint8_t> bytes, Consume consume) {
  uint32_t y = 0, base = 0, low = 0, high = 0, last_high = 0, overflow = 0;
  bool on = false;
  for (size_t at = 0; at + 1 < bytes.size(); at += 2) {
    const uint32_t word = static_cast<uint32_t>(bytes[at] | bytes[at + 1] << 8);
    switch (word >> 12) {
      case 0x0:
        y = word & 0x7ff;
        break;
      case 0x2:
        consume(word & 0x7ff, y, (word & 0x800) != 0, overflow + (high << 12) + low);
        break;
      case 0x3:
        base = word & 0x7ff;
        on = (word & 0x800) != 0;
        break;
      case 0x4:
      case 0x5: {
        const uint32_t count = word >> 12 == 4 ? 12 : 8;
        for (uint32_t k = 0; k < count; ++k) {
          if ((word >> k & 1) != 0) consume(base + k, y, on, overflow + (high << 12) + low);
        }
        base += count;
        break;
      }
      case 0x6:
        low = word & 0xfff;
        break;
      case 0x8:
        high = word & 0xfff;
        if (high < last_high) overflow += 1u << 24;
        last_high = high;
        break;
      default:
        break;
    }
  }
}

// Pfrommer, "Frequency Cam: imaging periodic signals in real-time" (arXiv 2211.00198), section 3:
// log intensity rebuilt from changes of polarity with a second-order high pass, zero crossings
// found by linear interpolation, the period from crossings of one direction.
class TextbookBlinkFilter {
 public:
  TextbookBlinkFilter(agent::SensorGeometry geometry, double blink_hz, double band_rel)
      : geometry_(geometry),
        low_s_(static_cast<float>((1 - band_rel) / blink_hz)),
        high_s_(static_cast<float>((1 + band_rel) / blink_hz)),
        states_(static_cast<size_t>(geometry.width) * geometry.height) {
    // Cut-off period of 5 events.
    const double omega = 2 * M_PI / 5;
    const double phi = 2 - std::cos(omega);
    const double alpha = (1 - std::sin(omega)) / std::cos(omega);
    const double beta = phi - std::sqrt(phi * phi - 1);
    c1_ = static_cast<float>(alpha + beta);
    c2_ = static_cast<float>(-alpha * beta);
    c3_ = static_cast<float>(0.5 * (1 + beta));
  }

  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) {
    State& s = states_[static_cast<size_t>(y) * geometry_.width + x];
    const float time_s = static_cast<float>(time_us) * 1e-6f;
    const float polarity = on ? 1.f : -1.f;
    const float level = c1_ * s.level1 + c2_ * s.level2 + c3_ * (polarity - s.polarity);
    if (level > 0 && s.level1 <= 0) {
      const float share = level / (level - s.level1);
      const float crossing_s = time_s - share * (time_s - s.time_s);
      s.period_s = crossing_s - s.crossing_s;
      s.crossing_s = crossing_s;
    }
    s.level2 = s.level1;
    s.level1 = level;
    s.polarity = polarity;
    s.time_s = time_s;
  }

  // 255 where a pixel blinks in the band.
  void Image(uint32_t time_us, cv::Mat1b* image) const {
    image->create(static_cast<int>(geometry_.height), static_cast<int>(geometry_.width));
    const float now_s = static_cast<float>(time_us) * 1e-6f;
    for (size_t i = 0; i < states_.size(); ++i) {
      const State& s = states_[i];
      image->data[i] =
          s.period_s >= low_s_ && s.period_s <= high_s_ && now_s - s.crossing_s < 2 * high_s_ ? 255
                                                                                              : 0;
    }
  }

  static constexpr int kBytesPerPixel = 24;

 private:
  struct State {
    float level1 = 0, level2 = 0, polarity = 0, time_s = 0, crossing_s = -1, period_s = 0;
  };
  static_assert(sizeof(State) == kBytesPerPixel);

  agent::SensorGeometry geometry_;
  float low_s_, high_s_, c1_, c2_, c3_;
  std::vector<State> states_;
};

inline cv::Ptr<cv::SimpleBlobDetector> TextbookBlobDetector() {
  cv::SimpleBlobDetector::Params params;
  params.filterByColor = true;
  params.blobColor = 255;
  params.filterByArea = true;
  params.minArea = 20;
  params.maxArea = 5000;
  params.filterByCircularity = params.filterByConvexity = params.filterByInertia = false;
  return cv::SimpleBlobDetector::create(params);
}

}  // namespace rigcal::testing
