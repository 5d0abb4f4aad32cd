// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/detect/event/blink_kernel.h"
#include "agent/event/event_words.h"

namespace rigcal::agent {

// The states of all pixels (the surface of active events) at one time. Does not own them.
struct BlinkSurface {
  SensorGeometry geometry;
  const uint32_t* states = nullptr;  // see BlinkRules; row by row, geometry.width each
  const uint32_t* tiles = nullptr;   // when a pixel of it last blinked; 0: never
  uint32_t tile_columns = 0, tile_rows = 0;
  uint32_t time_us = 0;  // the sensor's clock, lower 32 bits
  int shift = 0;         // units of 2^shift microseconds

  uint32_t now() const { return time_us >> shift; }  // in units
  const uint32_t* Row(int y) const { return states + static_cast<size_t>(y) * geometry.width; }
};

// From the seeds of a marker, as far as a burst is followed.
inline constexpr int kReachPx = 40;

// One of the frequencies that BlinkFilter looks for, compared with a pixel's state (BlinkRules) at
// the time `now`. Times in units of 2^shift microseconds unless named; periods between
// `shortest` and `longest` are nearest to this one.
struct BlinkPeriod {
  int index = 0;  // into BlinkFilterOptions::blink_hz
  double period_us = 0, band_rel = 0;
  uint32_t period = 0, lit = 0, shortest = 0, longest = 0;
  uint32_t over = 0;         // age at which a burst counts as over
  uint32_t min_periods = 0;  // in a row, before a pixel is a seed

  // The pixel blinks with this period.
  bool IsSeed(uint32_t state, uint32_t now) const {
    const uint32_t since = (now - (state >> 16)) & 0xffff;
    const uint32_t gap = state >> 4 & BlinkRules::kMaxGap;
    return (state & BlinkRules::kPeriodsMask) >= min_periods && since < period + over &&
           gap - shortest <= longest - shortest;
  }
  // Units since the pixel lit up in the last burst that is over; negative: it did not.
  int UnitsSinceBurst(uint32_t state, uint32_t now) const {
    const uint32_t last = (now - (state >> 16)) & 0xffff;
    if (last >= over) return static_cast<int>(last);
    const uint32_t gap = state >> 4 & BlinkRules::kMaxGap;
    return gap == BlinkRules::kMaxGap ? -1 : static_cast<int>(last + gap);
  }
};

// In the last burst or in the one before, between `newest` and `oldest` units ago.
inline bool LitUpBetween(uint32_t state, uint32_t now, uint32_t newest, uint32_t oldest) {
  const uint32_t last = (now - (state >> 16)) & 0xffff;
  const uint32_t gap = state >> 4 & BlinkRules::kMaxGap;
  return last - newest <= oldest - newest ||
         (gap != BlinkRules::kMaxGap && last + gap - newest <= oldest - newest);
}

// Of frequencies that BlinkFilterOptions allows, in their order; each has at most `band_rel`, and
// less where another is near.
std::vector<BlinkPeriod> BlinkPeriodsOf(const std::vector<double>& blink_hz, double band_rel,
                                        int min_periods, int shift);

}  // namespace rigcal::agent
