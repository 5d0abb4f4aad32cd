// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "agent/detect/event/blink_kernel.h"
#include "agent/event/event_decoder.h"

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

}  // namespace rigcal::agent
