// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_period.h"

#include <algorithm>
#include <cmath>

namespace rigcal::agent {
namespace {

// Of the way to the next frequency: within it a period belongs to this one.
constexpr double kOwnShare = 0.4;
// Of the time by which a period is shorter than the longest: its burst is looked for that much
// earlier, near the middle of the interval in which the burst of the longest lies.
constexpr double kLookBack = 0.8;

}  // namespace

std::vector<BlinkPeriod> BlinkPeriodsOf(const std::vector<double>& blink_hz, double band_rel,
                                        int min_periods, int shift) {
  std::vector<BlinkPeriod> blinks;
  const double longest = 1e6 / *std::min_element(blink_hz.begin(), blink_hz.end()) / (1 << shift);
  for (const double hz : blink_hz) {
    BlinkPeriod blink;
    blink.index = static_cast<int>(blinks.size());
    blink.period_us = 1e6 / hz;
    blink.band_rel = band_rel;
    const double units = blink.period_us / (1 << shift);
    double shortest = 0, past_longest = BlinkRules::kMaxGap;
    for (const double other_hz : blink_hz) {
      if (other_hz == hz) continue;
      const double ratio = std::max(hz / other_hz, other_hz / hz);
      blink.band_rel = std::min(blink.band_rel, kOwnShare * (1 - 1 / ratio));
      if (other_hz > hz) shortest = std::max(shortest, units / std::sqrt(ratio));
      if (other_hz < hz) past_longest = std::min(past_longest, units * std::sqrt(ratio));
    }
    blink.shortest = static_cast<uint32_t>(std::lround(shortest));
    blink.longest = static_cast<uint32_t>(std::lround(past_longest)) - 1;
    blink.period = static_cast<uint32_t>(std::lround(units));
    blink.lit = blink.period / 2;
    blink.over = blink.lit + static_cast<uint32_t>(std::lround(kLookBack * (longest - units)));
    blink.min_periods = static_cast<uint32_t>(min_periods);
    blinks.push_back(blink);
  }
  return blinks;
}

}  // namespace rigcal::agent
