// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/event_pixels.h"

#include <algorithm>
#include <cmath>

namespace rigcal {
namespace {

// A change of ln(light) that no threshold notices.
constexpr float kStill = 1e-4f;
// By which the dark slows the low pass at most.
constexpr float kDarkest = 20;

// 1 - exp(-x), right to 0.002 and never past 1: a step of the low pass must not overshoot.
float Approach(float x) { return 1 - 1 / (1 + x * (1 + x * (0.5f + x * (1.0f / 6)))); }

}  // namespace

EventPixels::EventPixels(const ImageSize& size, const EventRenderOptions& options, float led_light)
    : options_(options),
      width_(size.width),
      led_light_(led_light),
      random_({options.seed, 0x6a17}),
      pixels_(static_cast<size_t>(size.width) * size.height) {
  RandomStream draw({options.seed, 0x5b3d});
  const auto spread = [&draw](double sigma) {
    return static_cast<float>(std::max(0.1, 1 + sigma * draw.Gaussian()));
  };
  for (Pixel& pixel : pixels_) {
    pixel.on_scale = static_cast<float>(options.on_threshold) * spread(options.threshold_spread);
    pixel.off_scale = static_cast<float>(options.off_threshold) * spread(options.threshold_spread);
    pixel.refractory_us =
        static_cast<float>(options.refractory_us) * spread(options.refractory_spread);
    pixel.on_threshold = pixel.on_scale;
    pixel.off_threshold = pixel.off_scale;
  }
}

void EventPixels::Settle(uint32_t x, uint32_t y, float light) {
  Pixel& pixel = pixels_[static_cast<size_t>(y) * width_ + x];
  pixel.level = pixel.reference = light;
}

void EventPixels::DrawThresholds(Pixel* pixel) {
  pixel->on_threshold = pixel->on_scale * Jitter();
  pixel->off_threshold = pixel->off_scale * Jitter();
}

float EventPixels::TimeConstant(float light) const {
  const auto constant = static_cast<float>(options_.latency_us);
  if (options_.latency_slowdown == 0) return constant;
  const float darker = std::clamp(std::exp(led_light_ - light), 1.0f, kDarkest);
  return constant * (1 + static_cast<float>(options_.latency_slowdown) * (darker - 1));
}

void EventPixels::Fire(uint32_t x, uint32_t y, bool on, double time_us,
                       std::vector<PixelRequest>* requests) {
  Pixel& pixel = pixels_[static_cast<size_t>(y) * width_ + x];
  if (time_us < pixel.ready_us) return;
  pixel.ready_us = time_us + pixel.refractory_us;
  pixel.reference = pixel.level;
  requests->push_back({time_us, static_cast<uint16_t>(x), static_cast<uint16_t>(y), on});
}

void EventPixels::Follow(uint32_t x, uint32_t y, const PixelLight& light, double begin_us,
                         std::span<const LightStep> steps, std::vector<PixelRequest>* requests) {
  Pixel& pixel = pixels_[static_cast<size_t>(y) * width_ + x];
  const bool unlit = std::abs(light.lit_begin - light.dark_begin) < kStill &&
                     std::abs(light.lit_end - light.dark_end) < kStill;
  if (unlit && pixel.ready_us <= begin_us && std::abs(light.dark_end - pixel.level) < kStill &&
      std::abs(light.dark_begin - pixel.level) < kStill) {
    return;
  }
  const float dark_constant = TimeConstant(light.dark_end);
  const float lit_constant = unlit ? dark_constant : TimeConstant(light.lit_end);
  const auto whole = static_cast<float>(steps.back().end_us);
  float level = pixel.level;
  double time_us = begin_us;
  for (const LightStep& step : steps) {
    const float share = static_cast<float>(step.end_us) / whole;
    const float target = step.lit ? light.lit_begin + share * (light.lit_end - light.lit_begin)
                                  : light.dark_begin + share * (light.dark_end - light.dark_begin);
    const double end_us = begin_us + step.end_us;
    const float constant = step.lit ? lit_constant : dark_constant;
    const float next =
        constant > 0
            ? level + (target - level) * Approach(static_cast<float>(end_us - time_us) / constant)
            : target;
    const double slope = (next - level) / (end_us - time_us);
    double from_us = time_us;
    while (true) {
      if (pixel.ready_us > from_us) {
        if (pixel.ready_us > end_us) break;
        from_us = pixel.ready_us;
        pixel.reference = static_cast<float>(level + slope * (from_us - time_us));
      }
      const float moved = next - pixel.reference;
      const bool on = moved >= pixel.on_threshold;
      if (!on && moved > -pixel.off_threshold) break;
      const double crossing = pixel.reference + (on ? pixel.on_threshold : -pixel.off_threshold);
      const double at_us =
          slope == 0 ? from_us : std::clamp(time_us + (crossing - level) / slope, from_us, end_us);
      requests->push_back({at_us, static_cast<uint16_t>(x), static_cast<uint16_t>(y), on});
      pixel.reference = static_cast<float>(crossing);
      pixel.ready_us = at_us + pixel.refractory_us;
      DrawThresholds(&pixel);
      from_us = at_us;
    }
    level = next;
    time_us = end_us;
  }
  pixel.level = level;
}

}  // namespace rigcal
