// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "common/simulation/events/fast_math.h"

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

}  // namespace rigcal
