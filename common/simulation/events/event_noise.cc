// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_noise.h"

#include <algorithm>
#include <limits>

#include "common/simulation/events/fast_math.h"

namespace rigcal {
namespace {

// Of `count`, below it however that is rounded.
uint32_t Below(uint32_t count, double value) {
  return std::min(count - 1, static_cast<uint32_t>(value));
}

}  // namespace

EventNoise::EventNoise(const ImageSize& size, const EventRenderOptions& options)
    : draw_({options.seed, 0x9015e}),
      pixels_(size.width * size.height),
      background_(options.background_hz * pixels_),
      shot_(options.shot_hz * pixels_),
      leak_(options.leak_hz * pixels_) {
  RandomStream place({options.seed, 0x407});
  for (int i = 0; i < static_cast<int>(options.hot_pixels); ++i) {
    hot_.push_back(static_cast<uint32_t>(place.Uniform() * pixels_));
  }
  hot_total_ = options.hot_hz * static_cast<double>(hot_.size());
  total_ = background_ + shot_ + leak_ + hot_total_;
  mean_gap_us_ = total_ > 0 ? 1e6 / total_ : std::numeric_limits<double>::infinity();
  next_us_ = total_ > 0 ? Gap() : mean_gap_us_;
}

double EventNoise::Gap() {
  const float share = (static_cast<float>(draw_.Bits() >> 41) + 0.5f) * 0x1p-23f;
  return -mean_gap_us_ * static_cast<double>(FastLog(share));
}

void EventNoise::Until(double end_us, std::vector<NoiseEvent>* events) {
  const auto hot = static_cast<uint32_t>(hot_.size());
  const double background_scale = 2.0 * pixels_ / background_, shot_scale = 2.0 * pixels_ / shot_;
  const double leak_scale = pixels_ / leak_;
  const double hot_scale = 2.0 * hot / hot_total_;
  for (; next_us_ < end_us; next_us_ += Gap()) {
    double share = draw_.Uniform() * total_;
    if (share < background_) {
      const uint32_t which = Below(2 * pixels_, share * background_scale);
      events->push_back({next_us_, which / 2, which % 2 != 0});
      continue;
    }
    share -= background_;
    if (share < shot_) {
      const uint32_t which = Below(2 * pixels_, share * shot_scale);
      const auto least = static_cast<float>(1 - draw_.Uniform());
      events->push_back({next_us_, which / 2, which % 2 != 0, least});
      continue;
    }
    share -= shot_;
    if (share < leak_) {
      events->push_back({next_us_, Below(pixels_, share * leak_scale), true});
      continue;
    }
    const uint32_t which = Below(2 * hot, (share - leak_) * hot_scale);
    events->push_back({next_us_, hot_[which / 2], which % 2 != 0});
  }
}

}  // namespace rigcal
