// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/blinking_led.h"

#include <cmath>

namespace rigcal {
namespace {

// Nearer than that two switches are one.
constexpr double kShortestStepUs = 1e-3;

}  // namespace

bool BlinkingLed::IsLit(double time_s) const {
  if (hz <= 0) return true;
  const double turns = hz * time_s + phase;
  return turns - std::floor(turns) < duty;
}

void BlinkingLed::StepsOf(double begin_us, double duration_us,
                          std::vector<LightStep>* steps) const {
  steps->clear();
  double from_us = 0;
  const auto cut_at = [&](double cut_us) {
    if (cut_us - from_us < kShortestStepUs) return;
    steps->push_back({cut_us, IsLit(1e-6 * (begin_us + 0.5 * (from_us + cut_us)))});
    from_us = cut_us;
  };
  if (hz > 0) {
    const double period_us = 1e6 / hz;
    const double turns = 1e-6 * hz * begin_us + phase;
    for (double cycle = std::floor(turns);; ++cycle) {
      const double on_us = (cycle - turns) * period_us;
      if (on_us >= duration_us) break;
      for (const double cut : {on_us, on_us + duty * period_us}) {
        if (cut < duration_us - kShortestStepUs) cut_at(cut);
      }
    }
  }
  cut_at(duration_us);
}

}  // namespace rigcal
