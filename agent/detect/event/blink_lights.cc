// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_lights.h"

#include <algorithm>
#include <cmath>

#include "agent/detect/event/wrapped_time.h"

namespace rigcal::agent {
namespace {

// Of a period: within it two rises are of one light. The LED that sends a light code is two lights,
// whose rises are a tenth of a period apart (common/light_code).
constexpr double kSamePhase = 0.075;
// Of a period, and at most: pixels in the dark take several tenths of a millisecond.
constexpr double kAnswerShare = 0.2, kMostAnswerUs = 600;
// What one more burst changes of the period and of the time that the light shines.
constexpr double kGain = 0.3;

}  // namespace

double BlinkLight::AnswerUs() const {
  return std::min({kAnswerShare * period_us, kMostAnswerUs, lit_us, period_us - lit_us});
}

double BlinkLight::LastOn(double time_us) const {
  const double since_us = SinceUs(on_us, time_us) - lit_us - AnswerUs();
  const double last = std::floor((since_us - MarginUs()) / period_us);
  // The burst behind the last one seen, if only just over: else none would be new where bursts are
  // asked for as often as there are any.
  const bool next_is_over = last == 0 && since_us >= period_us;
  return on_us + (next_is_over ? 1 : last) * period_us;
}

size_t BlinkLights::IndexOf(int frequency, double on_us) const {
  size_t nearest = lights_.size();
  double least = kSamePhase;
  for (size_t i = lights_.size(); i-- > 0;) {
    const BlinkLight& light = lights_[i];
    const double away_us = std::remainder(SinceUs(light.on_us, on_us), light.period_us);
    const double away = std::abs(away_us) / light.period_us;
    if (light.frequency != frequency || away >= least) continue;
    nearest = i;
    least = away;
  }
  return nearest;
}

const BlinkLight* BlinkLights::Find(int frequency, double on_us) const {
  const size_t index = IndexOf(frequency, on_us);
  return index < lights_.size() ? &lights_[index] : nullptr;
}

void BlinkLights::Take(const BlinkLight& seen) {
  BlinkLight light = seen;
  const size_t index = IndexOf(seen.frequency, seen.on_us);
  if (index < lights_.size()) {
    light = lights_[index];
    const double since_us = SinceUs(light.on_us, seen.on_us);
    const double periods = std::round(since_us / light.period_us);
    if (periods >= 1) light.period_us += kGain * (since_us / periods - light.period_us);
    light.lit_us += kGain * (seen.lit_us - light.lit_us);
    if (since_us > 0) light.on_us = seen.on_us;
    lights_.erase(lights_.begin() + static_cast<std::ptrdiff_t>(index));
  } else if (lights_.size() == kMaxLights) {
    lights_.erase(lights_.begin());
  }
  lights_.push_back(light);
}

void BlinkLights::Forget(double time_us) {
  std::erase_if(lights_, [time_us](const BlinkLight& light) {
    return SinceUs(light.on_us, time_us) > kForgetPeriods * light.period_us;
  });
}

}  // namespace rigcal::agent
