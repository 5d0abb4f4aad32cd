// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>

#include "agent/detect/event/blink_kernel.h"

namespace rigcal::agent {
namespace {

// Vectors of the compiler: every CPU has them or is given scalar code for them.
constexpr size_t kLanes = 4;
using Unsigned = uint32_t __attribute__((vector_size(16)));
using Signed = int32_t __attribute__((vector_size(16)));
using Float = float __attribute__((vector_size(16)));

Signed ToSigned(Unsigned v) { return reinterpret_cast<Signed>(v); }
Unsigned ToUnsigned(Signed v) { return reinterpret_cast<Unsigned>(v); }

// Below 2^31 both.
Unsigned Exceeds(Unsigned a, Unsigned b) { return ToUnsigned(ToSigned(a) > ToSigned(b)); }

bool Any(Unsigned v) {
  uint64_t halves[2];
  std::memcpy(halves, &v, sizeof(v));
  return (halves[0] | halves[1]) != 0;
}

struct Rules {
  explicit Rules(const BlinkRules& rules)
      : shift(rules.shift),
        stride(static_cast<float>(rules.stride)),
        tile_columns(rules.tile_columns),
        min_gap(rules.min_gap),
        again_gap(rules.again_gap),
        low_gap(rules.low_gap),
        high_gap(rules.low_gap + rules.band_gap),
        min_periods(rules.min_periods) {}

  int shift;
  float stride;
  uint32_t tile_columns, min_gap, again_gap, low_gap, high_gap, min_periods;
};

// Of four events.
struct Events {
  Unsigned time_us;
  Unsigned place;  // x, above it y, in bit 31 whether it is brighter
};

Events Load(const PackedEvent* events) {
  Unsigned first, second;
  std::memcpy(&first, events, sizeof(first));
  std::memcpy(&second, events + 2, sizeof(second));
  return {__builtin_shufflevector(first, second, 0, 2, 4, 6),
          __builtin_shufflevector(first, second, 1, 3, 5, 7)};
}

// In the array of states.
Unsigned PixelsOf(const Rules& rules, const PackedEvent* events) {
  const Unsigned place = Load(events).place;
  // Whole numbers below 2^24.
  const Float row = __builtin_convertvector(ToSigned(place << 1 >> 17), Float);
  return ToUnsigned(__builtin_convertvector(row * rules.stride, Signed)) + (place & 0xffff);
}

// Without a branch: what kind an event is of cannot be foretold. `blinks`: all ones where it
// crossed and has periods enough.
Unsigned NewStates(const Rules& rules, const Events& events, Unsigned old, Unsigned* blinks) {
  const Unsigned now = events.time_us >> rules.shift;
  const Unsigned gap = (now - (old >> 16)) & 0xffff;
  static_assert(BlinkRules::kOnBit == 1 << 3);
  const Unsigned was_on = ToUnsigned(ToSigned(old << 28) >> 31);
  const Unsigned on = ToUnsigned(ToSigned(events.place) >> 31);
  const Unsigned crosses = on & Exceeds(gap, (was_on & rules.again_gap) + (rules.min_gap - 1));
  const Unsigned too_long = Exceeds(gap, Unsigned{} + rules.high_gap);
  const Unsigned good = Exceeds(gap, Unsigned{} + (rules.low_gap - 1)) & ~(was_on | too_long);
  const Unsigned count = (old & BlinkRules::kPeriodsMask) + 1;
  const Unsigned periods = (count - (count >> 3)) & good;
  *blinks = crosses & Exceeds(periods, Unsigned{} + (rules.min_periods - 1));
  const Unsigned clipped =
      (gap | Exceeds(gap, Unsigned{} + BlinkRules::kMaxGap)) & BlinkRules::kMaxGap;
  const Unsigned crossed = now << 16 | clipped << 4 | periods | BlinkRules::kOnBit;
  const Unsigned stays = (old & ~BlinkRules::kOnBit) | (on & BlinkRules::kOnBit);
  return stays ^ ((stays ^ crossed) & crosses);
}

uint32_t TileOf(const Rules& rules, const PackedEvent& event) {
  constexpr int kShift = BlinkRules::kTileShift;
  return (uint32_t{event.y()} >> kShift) * rules.tile_columns + (uint32_t{event.x} >> kShift);
}

// One event, in every lane.
void UpdateOne(const Rules& rules, const PackedEvent& event, uint32_t* states, uint32_t* tiles) {
  const PackedEvent same[kLanes] = {event, event, event, event};
  uint32_t& state = states[PixelsOf(rules, same)[0]];
  Unsigned blinks;
  state = NewStates(rules, Load(same), Unsigned{} + state, &blinks)[0];
  if (blinks[0] != 0) tiles[TileOf(rules, event)] = event.time_us | 1;
}

void UpdateFour(const Rules& rules, const PackedEvent* events, Unsigned pixels, uint32_t* states,
                uint32_t* tiles) {
  const Unsigned old = {states[pixels[0]], states[pixels[1]], states[pixels[2]], states[pixels[3]]};
  Unsigned blinks;
  const Unsigned updated = NewStates(rules, Load(events), old, &blinks);
  const Unsigned by_one = __builtin_shufflevector(pixels, pixels, 1, 2, 3, 0);
  const Unsigned by_two = __builtin_shufflevector(pixels, pixels, 2, 3, 0, 1);
  const Unsigned same = ToUnsigned(pixels == by_one) | ToUnsigned(pixels == by_two);
  if (Any(same)) [[unlikely]] {
    for (size_t i = 0; i < kLanes; ++i) UpdateOne(rules, events[i], states, tiles);
    return;
  }
  for (size_t i = 0; i < kLanes; ++i) states[pixels[i]] = updated[i];
  if (!Any(blinks)) return;
  for (size_t i = 0; i < kLanes; ++i) {
    uint32_t& tile = tiles[TileOf(rules, events[i])];
    tile ^= (tile ^ (events[i].time_us | 1)) & blinks[i];
  }
}

void UpdatePortable(const BlinkRules& rules_in, const PackedEvent* events, size_t count,
                    uint32_t* states, uint32_t* tiles) {
  const Rules rules(rules_in);
  // Noise comes from all over the sensor: the states are fetched into the cache some events ahead.
  constexpr size_t kAhead = 16;
  Unsigned ahead[kAhead];
  const size_t groups = count / kLanes;
  const auto look_ahead = [&](size_t group) {
    const Unsigned pixels = PixelsOf(rules, events + kLanes * group);
    for (size_t i = 0; i < kLanes; ++i) __builtin_prefetch(states + pixels[i], 1);
    ahead[group % kAhead] = pixels;
  };
  for (size_t group = 0; group < std::min(groups, kAhead); ++group) look_ahead(group);
  for (size_t group = 0; group < groups; ++group) {
    const Unsigned pixels = ahead[group % kAhead];
    if (group + kAhead < groups) look_ahead(group + kAhead);
    UpdateFour(rules, events + kLanes * group, pixels, states, tiles);
  }
  for (size_t i = kLanes * groups; i < count; ++i) UpdateOne(rules, events[i], states, tiles);
}

Unsigned Forget(Unsigned states, uint32_t now_units) {
  // The lower half does not borrow.
  const Unsigned gap = ((now_units << 16 | 0xffff) - states) >> 16;
  const Unsigned silent = Exceeds(gap, Unsigned{} + (BlinkRules::kForgetUnits - 1));
  const uint32_t forgotten = (now_units - BlinkRules::kForgetUnits) << 16;
  return (states & ~(silent & ~BlinkRules::kOnBit)) | (silent & forgotten);
}

void SweepPortable(uint32_t now_units, uint32_t* states, size_t count) {
  size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    Unsigned four;
    std::memcpy(&four, states + i, sizeof(four));
    four = Forget(four, now_units);
    std::memcpy(states + i, &four, sizeof(four));
  }
  for (; i < count; ++i) states[i] = Forget(Unsigned{} + states[i], now_units)[0];
}

}  // namespace

extern const BlinkKernel kPortableBlinkKernel;
const BlinkKernel kPortableBlinkKernel = {"portable", &UpdatePortable, &SweepPortable};

}  // namespace rigcal::agent
