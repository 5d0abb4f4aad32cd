// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "agent/event/event.h"

namespace rigcal::agent {

// The state of a pixel, 32 bits: bits 16 to 31 the time of the last upward crossing, 4 to 15 the
// units between the last two, 3 the last polarity, 0 to 2 how many periods in a row were the
// wand's. Units of 2^shift microseconds.
struct BlinkRules {
  static constexpr uint32_t kOnBit = 8;
  static constexpr uint32_t kPeriodsMask = 7;
  static constexpr uint32_t kMaxGap = 0xfff;
  // A pixel without events for so many units, eight periods or more, counts as one that never had
  // any.
  static constexpr uint32_t kForgetUnits = 0x2000;
  static constexpr int kTileShift = 4;

  int shift = 0;
  uint32_t stride = 0;        // pixels of a row, at most 2048
  uint32_t tile_columns = 0;  // tiles of 16 x 16 pixels in a row
  uint32_t min_gap = 0;       // from one crossing to the next, in units
  uint32_t again_gap = 0;     // that much more if the pixel was brighter already
  uint32_t low_gap = 0;       // shortest period that is the wand's
  uint32_t band_gap = 0;      // from that to the longest
  uint32_t min_periods = 0;   // before a pixel blinks
  uint32_t flip = 0;          // bit 31: an OFF event counts as an ON event, and the other way round
  // Bit 31: a period counts only if an OFF event came within it; without, only if none did.
  uint32_t needs_off = 1u << 31;
};

// Compiled for several instruction sets, all with the same result.
struct BlinkKernel {
  const char* name;

  // As if events were taken one after the other. A tile in which a pixel blinks gets the event's
  // time with the lowest bit set.
  void (*update)(const BlinkRules& rules, const PackedEvent* events, size_t count, uint32_t* states,
                 uint32_t* tiles);
  // Pixels without events for longer than kForgetUnits are set to that age.
  void (*sweep)(uint32_t now_units, uint32_t* states, size_t count);
};

// The fastest that this CPU can run; all that it can run, the portable one first.
const BlinkKernel& BestBlinkKernel();
std::vector<const BlinkKernel*> AvailableBlinkKernels();

}  // namespace rigcal::agent
