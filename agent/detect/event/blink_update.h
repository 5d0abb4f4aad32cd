// SPDX-License-Identifier: Apache-2.0
#pragma once

// The blink filter's kernel, for any instruction set of blink_lanes.h.
#include <cstddef>
#include <cstdint>

#include "agent/detect/event/blink_kernel.h"
#include "agent/detect/event/blink_lanes.h"

namespace rigcal::agent::RIGCAL_KERNEL {

constexpr uint32_t kPolarity = 1u << 31;

RIGCAL_INLINE Lanes PixelsOf(const BlinkRules& rules, const Events& events) {
  return Index(events.place & ~kPolarity, rules.stride);
}

// Without a branch: which kind an event is of cannot be predicted. `blinks`: those that crossed and
// have periods enough.
RIGCAL_INLINE Lanes NewStates(const BlinkRules& rules, const Events& events, Lanes old,
                              Mask* blinks) {
  const Lanes now = events.time_us >> rules.shift;
  const Lanes gap = (now - (old >> 16)) & 0xffff;
  static_assert(BlinkRules::kOnBit == 1 << 3);
  const Mask was_on = HighestBit(old << 28), on = HighestBit(events.place ^ rules.flip);
  const Lanes min_gap = Where(was_on, Spread(rules.again_gap)) + rules.min_gap;
  const Mask crosses = on & AtLeast(gap, min_gap);
  const Mask in_band = AtLeast(gap, Spread(rules.low_gap)) &
                       ~AtLeast(gap, Spread(rules.low_gap + rules.band_gap + 1)) &
                       HighestBit(old << 28 ^ rules.needs_off);
  const Lanes count = (old & BlinkRules::kPeriodsMask) + 1;
  static_assert(BlinkRules::kPeriodsMask == 7);
  const Lanes periods = Where(in_band, count - (count >> 3));
  *blinks = crosses & AtLeast(periods, Spread(rules.min_periods));
  const Lanes crossed =
      now << 16 | Min(gap, Spread(BlinkRules::kMaxGap)) << 4 | periods | BlinkRules::kOnBit;
  const Lanes stays = (old & ~BlinkRules::kOnBit) | Where(on, Spread(BlinkRules::kOnBit));
  return Select(crosses, crossed, stays);
}

// Lanes of one pixel take their turns.
RIGCAL_INLINE Mask UpdateInTurns(const BlinkRules& rules, const Events& events, Mask waiting,
                                 Lanes pixels, uint32_t* states) {
  Mask all_blinks{};
  while (Any(waiting)) {
    const Mask ready = FirstOfEqual(pixels, waiting);
    Mask blinks;
    const Lanes updated = NewStates(rules, events, Gather(ready, states, pixels), &blinks);
    Scatter(ready, updated, states, pixels);
    all_blinks |= blinks & ready;
    waiting &= ~ready;
  }
  return all_blinks;
}

RIGCAL_INLINE void MarkTiles(const BlinkRules& rules, const Events& events, Mask blinks,
                             uint32_t* tiles) {
  static_assert(BlinkRules::kTileShift == 4);
  const Lanes place = events.place >> 4 & 0x07ff0fff;
  Scatter(blinks, events.time_us | 1, tiles, Index(place, rules.tile_columns));
}

RIGCAL_INLINE void UpdateGroup(const BlinkRules& rules, const Events& events, Lanes pixels,
                               uint32_t* states, uint32_t* tiles) {
  const Mask all = First(kLanes);
  Mask blinks;
  if (AllDiffer(pixels)) [[likely]] {
    const Lanes updated = NewStates(rules, events, Gather(all, states, pixels), &blinks);
    Scatter(all, updated, states, pixels);
  } else {
    blinks = UpdateInTurns(rules, events, all, pixels, states);
  }
  if (Any(blinks)) MarkTiles(rules, events, blinks, tiles);
}

inline void Update(const BlinkRules& rules_in, const PackedEvent* events, size_t count,
                   uint32_t* states, uint32_t* tiles) {
  const BlinkRules rules = rules_in;  // no store to a state can change them
  constexpr size_t kRing = kGroupsAhead == 0 ? 1 : kGroupsAhead;
  Lanes ahead[kRing];
  const auto look_ahead = [&](size_t group) {
    const Lanes pixels = PixelsOf(rules, LoadEvents(events + kLanes * group));
    for (size_t i = 0; i < kLanes; ++i) __builtin_prefetch(states + pixels[i], 1);
    ahead[group % kRing] = pixels;
  };
  const size_t groups = count / kLanes;
  for (size_t group = 0; group < kGroupsAhead && group < groups; ++group) look_ahead(group);
  for (size_t group = 0; group < groups; ++group) {
    const Events some = LoadEvents(events + kLanes * group);
    const Lanes pixels = kGroupsAhead == 0 ? PixelsOf(rules, some) : ahead[group % kRing];
    if (kGroupsAhead != 0 && group + kGroupsAhead < groups) look_ahead(group + kGroupsAhead);
    UpdateGroup(rules, some, pixels, states, tiles);
  }
  const size_t left = count % kLanes;
  if (left == 0) return;
  PackedEvent padded[kLanes] = {};
  for (size_t i = 0; i < left; ++i) padded[i] = events[kLanes * groups + i];
  const Events some = LoadEvents(padded);
  const Mask blinks = UpdateInTurns(rules, some, First(left), PixelsOf(rules, some), states);
  if (Any(blinks)) MarkTiles(rules, some, blinks, tiles);
}

RIGCAL_INLINE Lanes Forget(Lanes states, uint32_t now_units) {
  // The lower half does not borrow.
  const Lanes gap = ((now_units << 16 | 0xffff) - states) >> 16;
  const Mask silent = AtLeast(gap, Spread(BlinkRules::kForgetUnits));
  const uint32_t forgotten = (now_units - BlinkRules::kForgetUnits) << 16;
  return Select(silent, (states & BlinkRules::kOnBit) | forgotten, states);
}

inline void Sweep(uint32_t now_units, uint32_t* states, size_t count) {
  size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) Store(Forget(Load(states + i), now_units), states + i);
  for (; i < count; ++i) states[i] = Forget(Spread(states[i]), now_units)[0];
}

extern const BlinkKernel kKernel;
const BlinkKernel kKernel = {RIGCAL_KERNEL_NAME, &Update, &Sweep};

}  // namespace rigcal::agent::RIGCAL_KERNEL
