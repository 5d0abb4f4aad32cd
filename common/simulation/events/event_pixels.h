// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/events/event_noise.h"
#include "common/simulation/events/event_readout.h"
#include "common/simulation/events/event_render_options.h"
#include "common/simulation/events/fast_math.h"
#include "common/simulation/world/random_stream.h"

namespace rigcal {

// The time constant of a photoreceptor by its light: shortest from some light on, and longer in the
// dark by a share that goes with 1 / light.
struct LowPassSpeed {
  float tau_us = 0;      // at `full_light` and above
  float slowdown = 0;    // 0: the same everywhere
  float full_light = 0;  // ln(light)

  float TauUs(float light) const {
    constexpr float kDarkest = 3;         // ln(light): beyond that the dark slows it no more
    constexpr float kLeastTauUs = 0.01f;  // below that it is none
    const float below = full_light - light;
    const float darker = below > 0 ? (below < kDarkest ? below : kDarkest) : 0;
    const float constant = tau_us * (1 - slowdown + slowdown * FastExpWithin87(darker));
    return constant > kLeastTauUs ? constant : kLeastTauUs;
  }
};

// The response of a first-order low pass to an input that changes linearly from `from` to `to` in
// `duration_us`:
//
//   level(t) = from + slope t - lag + amplitude exp(-t / tau),   slope = (to - from) / duration,
//   lag = slope tau,  amplitude = level(0) - from + lag.
//
// Worked out exactly, however long the stretch.
class LowPassAnswer {
 public:
  // `tau_us` > 0.
  LowPassAnswer(float level, float from, float to, float duration_us, float tau_us)
      : LowPassAnswer(level, from, to, duration_us, tau_us, 0) {
    end_ = At(duration_us);
  }
  // The same where the level at the end is known.
  LowPassAnswer(float level, float from, float to, float duration_us, float tau_us, float end)
      : tau_us_(tau_us),
        slope_((to - from) / duration_us),
        base_(from - slope_ * tau_us),
        amplitude_(level - base_),
        end_(end) {}

  float end() const { return end_; }
  float At(float t_us) const {
    return base_ + slope_ * t_us + amplitude_ * FastDecay(t_us / tau_us_);
  }
  // Sure, if false.
  bool MayTurn() const { return slope_ * amplitude_ > 0; }
  // The turning point of the level, at most one; none: below 0 or beyond the end.
  float TurnUs() const {
    const float lag = slope_ * tau_us_;
    // exp(-t / tau) = lag / amplitude there.
    if (!(lag * amplitude_ > 0) || std::abs(lag) >= std::abs(amplitude_)) return -1;
    return tau_us_ * FastLog(amplitude_ / lag);
  }
  // When it passes `level`, upwards or downwards, between two times within which it does not turn;
  // the first of them where it has passed already.
  float ReachUs(float level, bool upwards, float low_us, float high_us) const {
    // As if the exponential were all that changes, or where that never comes there, the line.
    const float share = (level - base_ - slope_ * low_us) / amplitude_;
    float t = share > 1e-6f && share < 1 ? -tau_us_ * FastLog(share) : (level - base_) / slope_;
    // Newton; where it leaves what is known to hold the time, halves.
    for (int step = 0; step < 20; ++step) {
      if (!(t > low_us && t < high_us)) t = 0.5f * (low_us + high_us);
      const float decay = amplitude_ * FastDecay(t / tau_us_);
      const float away = base_ + slope_ * t + decay - level;
      ((away < 0) == upwards ? low_us : high_us) = t;
      const float steepness = slope_ - decay / tau_us_;
      const float change = away / steepness;
      t -= change;
      // The remainder of the bend for the next step.
      const float left = change * change * std::abs(decay);
      if (left < kTimeUs * std::abs(steepness) * tau_us_ * tau_us_) break;
      if (high_us - low_us < kTimeUs) break;
    }
    return std::fmin(std::fmax(t, low_us), high_us);
  }

 private:
  static constexpr float kTimeUs = 0.2f;
  float tau_us_, slope_, base_, amplitude_, end_;
};

// Normal numbers for the price of a look in a table: 4096 equally likely values of mean 0 and
// sigma 1, up to 3.7 sigma away. 12 random bits choose one.
class NormalQuantiles {
 public:
  NormalQuantiles() {
    double sigma = 0;
    for (size_t i = 0; i < kCount / 2; ++i) {
      const double share = (static_cast<double>(i) + 0.5) / kCount;
      // Newton on the distribution above its middle, from the value before.
      for (int step = 0; step < 8; ++step) {
        const double beyond = 0.5 * std::erf(sigma / std::numbers::sqrt2) - share;
        const double density = std::exp(-0.5 * sigma * sigma) / std::sqrt(2 * std::numbers::pi);
        sigma -= beyond / density;
      }
      values_[kCount / 2 + i] = static_cast<float>(sigma);
      values_[kCount / 2 - 1 - i] = static_cast<float>(-sigma);
    }
  }

  // By the lowest 12 of `bits`.
  float At(uint64_t bits) const { return values_[bits % kCount]; }

 private:
  static constexpr size_t kCount = 4096;
  std::array<float, kCount> values_;
};

// Photoreceptors and comparators of a sensor (see EventRenderOptions). One thread at a time.
class EventPixels {
 public:
  // `led_light`: ln(light) at which the low pass has its full speed.
  EventPixels(const ImageSize& size, const EventRenderOptions& options, float led_light);

  // As if the pixel had seen this light for long.
  void Settle(uint32_t x, uint32_t y, float light);
  // Neighbours in a row from column x on, to be followed by FollowAdded, each pixel once: ln(light)
  // at the stretch's beginning and end. With no `from`: from what each saw last.
  void Add(uint32_t x, uint32_t y, std::span<const float> from, std::span<const float> to);
  // Follows what was added; its light goes linearly. Appends what the pixels ask.
  void FollowAdded(double begin_us, double duration_us, std::vector<PixelRequest>* requests);
  // Comparators that fire by themselves, unless held in reset. Shot noise falls linearly with the
  // light, from all of it in the dark to a quarter at the LED's light and above: the model of v2e
  // (Hu, Liu, Delbruck, "v2e: From Video Frames to Realistic DVS Events", CVPRW 2021).
  void Fire(std::span<const NoiseEvent> noise, std::vector<PixelRequest>* requests);

 private:
  // Half a cache line.
  struct alignas(32) Pixel {
    double ready_us = 0;  // held in reset until then
    float light = 0;      // what it saw last
    float level = 0;      // behind the low pass
    float reference = 0;
    float on_threshold = 0, off_threshold = 0;  // of the next event
    float refractory_us = 0;
  };
  struct Scales {
    float on = 0, off = 0;
  };
  void DrawThresholds(size_t index);
  void FollowBlock(size_t first, size_t count, double begin_us, double duration_us,
                   std::vector<PixelRequest>* requests);
  void Cross(uint32_t index, const LowPassAnswer& answer, double begin_us, float duration_us,
             std::vector<PixelRequest>* requests);

  float jitter_;
  LowPassSpeed speed_;
  uint32_t width_;
  NormalQuantiles normal_;
  RandomStream random_;
  std::vector<Pixel> pixels_;
  std::vector<Scales> scales_;
  // The added events.
  std::vector<uint32_t> index_;
  std::vector<float> from_, to_;
};

}  // namespace rigcal
