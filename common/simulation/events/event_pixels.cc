// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_pixels.h"

#include <algorithm>
#include <cstddef>
#include <numeric>

namespace rigcal {
namespace {

// Of what is drawn about 1: no threshold and no refractory period vanishes.
constexpr float kLeastFactor = 0.1f;
// Pixels worked out at once, and those whose arithmetic is done side by side.
constexpr size_t kBlock = 256;
constexpr size_t kLanes = 8;
// Memory of pixels is asked for so many noise events ahead.
constexpr size_t kAhead = 12;
// Of the shot noise in the dark: what is left at the light of the LED.
constexpr float kShotShareAtLed = 0.25f;

// Low passes of a block within a stretch of time: their levels at its end, and what they do not
// leave within it.
struct alignas(4 * kLanes) Block {
  float level[kBlock], from[kBlock], to[kBlock];
  float tau_us[kBlock], end[kBlock], low[kBlock], high[kBlock];
};

// Vector code: no branches, no calls and no rest.
inline __attribute__((always_inline)) void AnswerLanes(const LowPassSpeed& speed, float duration_us,
                                                       size_t first, Block* block) {
  for (size_t i = first; i < first + kLanes; ++i) {
    const float from = block->from[i], to = block->to[i];
    const float tau_us = speed.TauUs(to);
    const LowPassAnswer answer(block->level[i], from, to, duration_us, tau_us);
    const float end = answer.end();
    // At its turning point the level is on the line of its input.
    const float lesser = from < to ? from : to, greater = from < to ? to : from;
    const bool turns = answer.MayTurn();
    block->tau_us[i] = tau_us;
    block->end[i] = end;
    block->low[i] = turns && lesser < end ? lesser : end;
    block->high[i] = turns && greater > end ? greater : end;
  }
}

#if defined(__x86_64__)
// The same sums in wider lanes.
__attribute__((target("avx2"))) void AnswerWide(const LowPassSpeed& speed, float duration_us,
                                                size_t count, Block* block) {
  for (size_t first = 0; first < count; first += kLanes) {
    AnswerLanes(speed, duration_us, first, block);
  }
}
const bool kHasWide = __builtin_cpu_supports("avx2") != 0;
#endif

void Answer(const LowPassSpeed& speed, float duration_us, size_t count, Block* block) {
  for (size_t i = count; i % kLanes != 0; ++i) block->level[i] = block->from[i] = block->to[i] = 0;
#if defined(__x86_64__)
  if (kHasWide) return AnswerWide(speed, duration_us, count, block);
#endif
  for (size_t first = 0; first < count; first += kLanes) {
    AnswerLanes(speed, duration_us, first, block);
  }
}

}  // namespace

EventPixels::EventPixels(const ImageSize& size, const EventRenderOptions& options, float led_light)
    : jitter_(static_cast<float>(options.threshold_jitter)),
      speed_{static_cast<float>(options.latency_us), static_cast<float>(options.latency_slowdown),
             led_light},
      width_(size.width),
      random_({options.seed, 0x6a17}),
      pixels_(static_cast<size_t>(size.width) * size.height),
      scales_(pixels_.size()) {
  RandomStream draw({options.seed, 0x5b3d});
  const auto spread = [this](double mean, double sigma, uint64_t bits) {
    const float factor = 1 + static_cast<float>(sigma) * normal_.At(bits);
    return static_cast<float>(mean) * std::max(kLeastFactor, factor);
  };
  for (size_t i = 0; i < pixels_.size(); ++i) {
    const uint64_t bits = draw.Bits();
    scales_[i].on = spread(options.on_threshold, options.threshold_spread, bits);
    scales_[i].off = spread(options.off_threshold, options.threshold_spread, bits >> 20);
    pixels_[i].refractory_us = spread(options.refractory_us, options.refractory_spread, bits >> 40);
    DrawThresholds(i);
  }
}

void EventPixels::Settle(uint32_t x, uint32_t y, float light) {
  Pixel& pixel = pixels_[static_cast<size_t>(y) * width_ + x];
  pixel.light = pixel.level = pixel.reference = light;
}

void EventPixels::DrawThresholds(size_t index) {
  const uint64_t bits = random_.Bits();
  Pixel& pixel = pixels_[index];
  const float on = 1 + jitter_ * normal_.At(bits), off = 1 + jitter_ * normal_.At(bits >> 20);
  pixel.on_threshold = scales_[index].on * std::max(kLeastFactor, on);
  pixel.off_threshold = scales_[index].off * std::max(kLeastFactor, off);
}

void EventPixels::Fire(std::span<const NoiseEvent> noise, std::vector<PixelRequest>* requests) {
  for (size_t i = 0; i < noise.size(); ++i) {
    if (i + kAhead < noise.size()) __builtin_prefetch(&pixels_[noise[i + kAhead].pixel], 1);
    const NoiseEvent& event = noise[i];
    Pixel& pixel = pixels_[event.pixel];
    if (event.time_us < pixel.ready_us) continue;
    if (event.shot_share > 0) {
      const float light =
          FastExpWithin87(std::clamp(pixel.level - speed_.full_light, -80.0f, 0.0f));
      if (event.shot_share > 1 - (1 - kShotShareAtLed) * light) continue;
    }
    pixel.ready_us = event.time_us + static_cast<double>(pixel.refractory_us);
    pixel.reference = pixel.level;
    requests->push_back({event.time_us, static_cast<uint16_t>(event.pixel % width_),
                         static_cast<uint16_t>(event.pixel / width_), event.on});
  }
}

void EventPixels::Add(uint32_t x, uint32_t y, std::span<const float> from,
                      std::span<const float> to) {
  const uint32_t first = y * width_ + x;
  const size_t added = index_.size(), count = to.size();
  index_.resize(added + count);
  std::iota(index_.end() - static_cast<std::ptrdiff_t>(count), index_.end(), first);
  from_.resize(added + count);
  if (from.empty()) {
    for (size_t i = 0; i < count; ++i) from_[added + i] = pixels_[first + i].light;
  } else {
    std::copy(from.begin(), from.end(), &from_[added]);
  }
  to_.insert(to_.end(), to.begin(), to.end());
}

void EventPixels::FollowAdded(double begin_us, double duration_us,
                              std::vector<PixelRequest>* requests) {
  for (size_t first = 0; first < index_.size(); first += kBlock) {
    FollowBlock(first, std::min(kBlock, index_.size() - first), begin_us, duration_us, requests);
  }
  index_.clear();
  from_.clear();
  to_.clear();
}

void EventPixels::FollowBlock(size_t first, size_t count, double begin_us, double duration_us,
                              std::vector<PixelRequest>* requests) {
  Block block;
  for (size_t i = 0; i < count; ++i) block.level[i] = pixels_[index_[first + i]].level;
  std::copy_n(&from_[first], count, block.from);
  std::copy_n(&to_[first], count, block.to);
  const auto short_us = static_cast<float>(duration_us);
  Answer(speed_, short_us, count, &block);
  for (size_t i = 0; i < count; ++i) {
    const uint32_t index = index_[first + i];
    Pixel& pixel = pixels_[index];
    const bool quiet = pixel.ready_us <= begin_us &&
                       block.high[i] - pixel.reference < pixel.on_threshold &&
                       pixel.reference - block.low[i] < pixel.off_threshold;
    if (!quiet && pixel.ready_us < begin_us + duration_us) {
      const LowPassAnswer answer(block.level[i], block.from[i], block.to[i], short_us,
                                 block.tau_us[i], block.end[i]);
      Cross(index, answer, begin_us, short_us, requests);
    }
    pixel.light = block.to[i];
    pixel.level = block.end[i];
  }
}

void EventPixels::Cross(uint32_t index, const LowPassAnswer& answer, double begin_us,
                        float duration_us, std::vector<PixelRequest>* requests) {
  Pixel& pixel = pixels_[index];
  float from_us = 0;
  if (pixel.ready_us > begin_us) {
    from_us = static_cast<float>(pixel.ready_us - begin_us);
    pixel.reference = answer.At(from_us);
  }
  const float turn_us = answer.TurnUs();
  for (const float until_us : {turn_us < duration_us ? turn_us : -1.0f, duration_us}) {
    while (from_us < until_us) {
      const float until = until_us == duration_us ? answer.end() : answer.At(until_us);
      const float moved = until - pixel.reference;
      const bool on = moved >= pixel.on_threshold;
      if (!on && moved > -pixel.off_threshold) break;
      const float crossing = pixel.reference + (on ? pixel.on_threshold : -pixel.off_threshold);
      const float at_us = answer.ReachUs(crossing, on, from_us, until_us);
      requests->push_back({begin_us + static_cast<double>(at_us),
                           static_cast<uint16_t>(index % width_),
                           static_cast<uint16_t>(index / width_), on});
      DrawThresholds(index);
      from_us = at_us + pixel.refractory_us;
      pixel.ready_us = begin_us + static_cast<double>(from_us);
      pixel.reference = crossing;
      if (from_us >= duration_us) return;
      if (from_us > at_us) pixel.reference = answer.At(from_us);
    }
    from_us = std::max(from_us, until_us);
  }
}

}  // namespace rigcal
