// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "agent/event/event.h"

namespace rigcal::agent {

// What BlinkFilter knows of a pixel, in 32 bits: bits 16 to 31 the time of the last upward
// crossing, 4 to 15 the units between the last two, 3 whether it is brighter, 0 to 2 how many
// periods in a row were the wand's. Units of 2^shift microseconds.
struct BlinkRules {
  static constexpr uint32_t kOnBit = 8;
  static constexpr uint32_t kPeriodsMask = 7;
  static constexpr uint32_t kMaxGap = 0xfff;
  // A pixel that has been silent for so many units, eight periods or more, is as one that never
  // spoke.
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
};

// The filter's work on every event and every pixel, compiled for several instruction sets, all with
// the same result.
struct BlinkKernel {
  const char* name;

  // Takes events one after the other. A tile in which a pixel blinks is given the event's time, its
  // lowest bit set.
  void (*update)(const BlinkRules& rules, const PackedEvent* events, size_t count, uint32_t* states,
                 uint32_t* tiles);
  // Sets pixels that have been silent for kForgetUnits or longer to just that.
  void (*sweep)(uint32_t now_units, uint32_t* states, size_t count);
};

// The best this CPU has; all that it has, the plainest first.
const BlinkKernel& BestBlinkKernel();
std::vector<const BlinkKernel*> AvailableBlinkKernels();

}  // namespace rigcal::agent
