// SPDX-License-Identifier: Apache-2.0
#pragma once

// The kernel of the EVT 3.0 decoder, for any instruction set of evt3_lanes.h.
#include <cstddef>
#include <cstdint>

#include "agent/event/evt3_kernel.h"
#include "agent/event/evt3_lanes.h"

namespace rigcal::agent::RIGCAL_KERNEL {

static_assert(kLanes <= static_cast<int>(Evt3Kernel::kBlockWords));

// A block's words and those of them that are of the commonest types.
struct Block {
  Words words, types;
  Mask rows, columns, times;

  RIGCAL_INLINE Mask Are(uint32_t type) const { return Equal(types, Spread(type)); }
};

struct Vectors {
  Mask all, of_eight;
  Words base;       // of the words that are vectors: column * 2 + polarity
  Words base_next;  // behind each word
  bool good;
};

RIGCAL_INLINE Vectors FindVectors(const Block& block, const Evt3State& limits, Words base_before) {
  const Mask of_twelve = block.Are(0x4), bases = block.Are(0x3);
  Vectors vectors;
  vectors.of_eight = block.Are(0x5);
  vectors.all = of_twelve | vectors.of_eight;
  const Mask idle = block.Are(0x7) | block.Are(0xE) | block.Are(0xF) |
                    Equal(block.words, Spread(limits.known_high));
  const Mask known = block.rows | block.columns | block.times | bases | vectors.all | idle;
  const Words length = Where(of_twelve, Spread(24)) | Where(vectors.of_eight, Spread(16));
  const Words behind = SumForward(length);
  const Words here = behind - length;
  // Relative to the lengths before it a base holds as a row does.
  const Words given = (block.words << 1 & 0xffe) | (block.words >> 11 & 1);
  const Words origin = FillForward(SetsOf(bases, bases).first, given - here, base_before);
  vectors.base = origin + here;
  vectors.base_next = origin + behind;
  const Mask outside = vectors.all & Greater(vectors.base_next >> 1, Spread(limits.width));
  vectors.good = !Any(Not(known) | outside);
  return vectors;
}

// One event, or those of a vector, from each word of `set`.
template <typename Set>
RIGCAL_INLINE PackedEvent* StoreRuns(const Places& places, uint32_t high_us, Words pixels, Set set,
                                     PackedEvent* to) {
  alignas(64) uint64_t events[kLanes];
  alignas(64) Pixels masks[kLanes];
  StoreEvents(places, high_us, set, events);
  StorePixels(pixels, set, masks);
  // Behind the last word of `set` the masks are empty. To stop there would be mispredicted.
  for (int i = 0; i < kLanes / 2; ++i) to = StoreRun(events[i], masks[i], to);
  if (__builtin_popcount(set) > kLanes / 2) {
    for (int i = kLanes / 2; i < kLanes; ++i) to = StoreRun(events[i], masks[i], to);
  }
  return to;
}

inline Evt3Kernel::Position Decode(Evt3Kernel::Position from, const uint8_t* end,
                                   const PackedEvent* full, Evt3State* state) {
  const Evt3State limits = *state;
  const Words last_column = Spread(limits.width - 1), last_row = Spread(limits.height - 1);
  const Words known_high = Spread(limits.known_high);
  Words held_row = Spread(limits.y), held_time = Spread(limits.time_low);
  Words held_base = Spread(limits.base);
  const uint8_t* at = from.at;
  PackedEvent* to = from.to;
  for (; static_cast<size_t>(end - at) >= 2 * Evt3Kernel::kBlockWords && to < full;
       at += 2 * kLanes) {
    Block block;
    block.words = LoadWords(at);
    block.types = block.words >> 12;
    block.rows = block.Are(0x0);
    block.columns = block.Are(0x2);
    block.times = block.Are(0x6);
    const Words place = block.words & 0x7ff;
    const Mask outside =
        (block.columns & Greater(place, last_column)) | (block.rows & Greater(place, last_row));
    const Mask rare =
        Not(block.rows | block.columns | block.times | Equal(block.words, known_high));
    if (Any(outside)) break;
    const Sets rows_columns = SetsOf(block.rows, block.columns);
    const Sets times_rare = SetsOf(block.times, rare);
    const Words row = FillForward(rows_columns.first, place, held_row);
    Places places;
    places.time_low = FillForward(times_rare.first, block.words & 0xfff, held_time);
    places.column = place;
    places.row_polarity = row | (block.words & 0x800) << 4;
    if (times_rare.second == 0) {
      StoreEvents(places, limits.high_us, rows_columns.second, to);
      to += __builtin_popcount(rows_columns.second);
    } else {
      const Vectors vectors = FindVectors(block, limits, held_base);
      if (!vectors.good) break;
      places.column = Select(vectors.all, vectors.base >> 1, place);
      places.row_polarity = Select(vectors.all, row | vectors.base << 15, places.row_polarity);
      const Words pixels = block.words & Select(vectors.of_eight, Spread(0xff), Spread(0xfff));
      const Mask sources = block.columns | vectors.all;
      to = StoreRuns(places, limits.high_us, Select(block.columns, Spread(1), pixels),
                     SetsOf(sources, sources).first, to);
      held_base = Hold(vectors.base_next);
    }
    held_row = Hold(row);
    held_time = Hold(places.time_low);
  }
  state->y = LastOf(held_row);
  state->time_low = LastOf(held_time);
  state->base = LastOf(held_base);
  return {at, to};
}

extern const Evt3Kernel kKernel;
const Evt3Kernel kKernel = {RIGCAL_KERNEL_NAME, &Decode};

}  // namespace rigcal::agent::RIGCAL_KERNEL
