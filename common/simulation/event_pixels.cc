// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/event_pixels.h"

#include <algorithm>
#include <cmath>

namespace rigcal {
namespace {

// Of what is drawn about 1: no threshold and no refractory period vanishes.
constexpr float kLeastFactor = 0.1f;
// Pixels worked out at once, and those whose arithmetic is done side by side.
constexpr size_t kChunk = 64;
constexpr size_t kLanes = 8;
// Memory of pixels is asked for so many noise events ahead.
constexpr size_t kAhead = 12;

// A chunk's low passes within a stretch of time.
struct alignas(4 * kLanes) Chunk {
  float level[kChunk], from[kChunk], to[kChunk], end[kChunk];
};

// Vector code: no branches, no calls and no rest.
void Answer(const LowPassSpeed& speed, float duration_us, size_t count, Chunk* chunk) {
  for (size_t lane = count; lane % kLanes != 0; ++lane) {
    chunk->level[lane] = chunk->from[lane] = chunk->to[lane] = 0;
  }
  for (size_t first = 0; first < count; first += kLanes) {
    const float* const level = chunk->level + first;
    const float* const from = chunk->from + first;
    const float* const to = chunk->to + first;
    float* const end = chunk->end + first;
    for (size_t i = 0; i < kLanes; ++i) {
      end[i] = LowPassAnswer(level[i], from[i], to[i], duration_us, speed.TauUs(to[i])).end();
    }
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
    pixel.ready_us = event.time_us + static_cast<double>(pixel.refractory_us);
    pixel.reference = pixel.level;
    requests->push_back({event.time_us, static_cast<uint16_t>(event.pixel % width_),
                         static_cast<uint16_t>(event.pixel / width_), event.on});
  }
}

void EventPixels::FollowRow(uint32_t x, uint32_t y, std::span<const float> from,
                            std::span<const float> to, double begin_us, double duration_us,
                            std::vector<PixelRequest>* requests) {
  Chunk chunk;
  for (size_t first = 0; first < to.size(); first += kChunk) {
    const size_t count = std::min(kChunk, to.size() - first);
    const auto column = x + static_cast<uint32_t>(first);
    Pixel* const pixels = &pixels_[static_cast<size_t>(y) * width_ + column];
    for (size_t i = 0; i < count; ++i) {
      chunk.level[i] = pixels[i].level;
      chunk.from[i] = from.empty() ? pixels[i].light : from[first + i];
      chunk.to[i] = to[first + i];
    }
    const auto short_us = static_cast<float>(duration_us);
    Answer(speed_, short_us, count, &chunk);
    for (size_t i = 0; i < count; ++i) {
      Pixel& pixel = pixels[i];
      const float end = chunk.end[i], begin = chunk.from[i], target = chunk.to[i];
      // Where the level turns it is on the line of its input: none of these misses a crossing.
      const float high = std::max(end, std::max(begin, target)) - pixel.reference;
      const float low = std::min(end, std::min(begin, target)) - pixel.reference;
      const bool quiet =
          pixel.ready_us <= begin_us && high < pixel.on_threshold && low > -pixel.off_threshold;
      if (!quiet && pixel.ready_us < begin_us + duration_us) {
        const LowPassAnswer answer(chunk.level[i], begin, target, short_us, speed_.TauUs(target));
        Cross(column + static_cast<uint32_t>(i), y, answer, begin_us, short_us, requests);
      }
      pixel.light = target;
      pixel.level = end;
    }
  }
}

void EventPixels::Cross(uint32_t x, uint32_t y, const LowPassAnswer& answer, double begin_us,
                        float duration_us, std::vector<PixelRequest>* requests) {
  const size_t index = static_cast<size_t>(y) * width_ + x;
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
      requests->push_back({begin_us + static_cast<double>(at_us), static_cast<uint16_t>(x),
                           static_cast<uint16_t>(y), on});
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
