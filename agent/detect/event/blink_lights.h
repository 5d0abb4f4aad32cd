// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace rigcal::agent {

// When an LED shines, as pixels answer it: from on_us + k period_us for lit_us, for every k. Times
// are the lower 32 bits of the sensor's clock.
struct BlinkLight {
  int frequency = 0;  // which of BlinkFilterOptions::blink_hz that is
  double on_us = 0;
  double period_us = 0;
  double lit_us = 0;
  double before_us = 0;  // before each rise: what pixels fire then is of interest, too

  // Pixels answer the light's rise and its fall within this time.
  double AnswerUs() const;
  // By which its next rise may be away from where it is expected.
  double MarginUs() const { return 0.06 * period_us; }
  // The last rise whose burst all pixels have answered at `time_us`.
  double LastOn(double time_us) const;
};

// The lights that were seen lately. LEDs of one wand mostly have one driver, and are one light; two
// wands, or LEDs with oscillators of their own, are several. One thread at a time.
class BlinkLights {
 public:
  static constexpr int kMaxLights = 8;  // then the one seen longest ago goes
  static constexpr double kForgetPeriods = 200;

  // The light that rises at this time; nullptr: none is known that does.
  const BlinkLight* Find(int frequency, double on_us) const;
  // One of the bursts of a light, with what is known of its period; of a known light the period is
  // worked out from the time since the last one.
  void Take(const BlinkLight& seen);
  // Those not seen for long.
  void Forget(double time_us);
  void Clear() { lights_.clear(); }

  std::span<const BlinkLight> all() const { return lights_; }

 private:
  size_t IndexOf(int frequency, double on_us) const;

  std::vector<BlinkLight> lights_;  // in the order in which they were seen last
};

}  // namespace rigcal::agent
