// SPDX-License-Identifier: Apache-2.0
#include <bit>
#include <cstring>

#include "agent/event/evt3_kernel.h"

namespace rigcal::agent {
namespace {

template <typename Word>
Word Load(const uint8_t* bytes) {
  static_assert(std::endian::native == std::endian::little);
  Word word;
  std::memcpy(&word, bytes, sizeof(word));
  return word;
}

void Store(uint64_t event, PackedEvent* to) { std::memcpy(to, &event, sizeof(event)); }

// What an event is made of, each at its place there; variables of a loop.
struct Held {
  uint64_t time_us;  // bits 0 to 31
  uint64_t row;      // bits 48 to 63
  uint32_t base;
};

// Most vectors are one run of pixels: no branch for each.
PackedEvent* Spread(uint64_t event, uint32_t mask, PackedEvent* to) {
  constexpr uint64_t kStep = uint64_t{1} << 32;
  const uint32_t first = static_cast<uint32_t>(std::countr_zero(mask | 0x1000));
  const uint32_t run = mask >> first;
  if ((run & (run + 1)) == 0) [[likely]] {
    event += first * kStep;
    for (uint32_t k = 0; k < 12; ++k) Store(event + k * kStep, to + k);
    return to + std::countr_zero(~run);
  }
  for (; mask != 0; mask &= mask - 1) {
    Store(event + static_cast<uint64_t>(std::countr_zero(mask)) * kStep, to++);
  }
  return to;
}

template <uint32_t kLength>
bool TakeVector(uint32_t word, const Evt3State& limits, Held* held, PackedEvent** to) {
  const uint32_t x = held->base >> 1;
  if (x + kLength > limits.width) return false;
  *to = Spread(held->time_us | static_cast<uint64_t>(x) << 32 | held->row |
                   static_cast<uint64_t>(held->base & 1) << 63,
               word & ((1u << kLength) - 1), *to);
  held->base += 2 * kLength;
  return true;
}

// False: left to others, and nothing has changed.
bool Take(uint32_t word, const Evt3State& limits, Held* held, PackedEvent** to) {
  const uint32_t place = word & 0x7ff;
  switch (word >> 12) {
    case 0x0:
      if (place >= limits.height) return false;
      held->row = static_cast<uint64_t>(place) << 48;
      return true;
    case 0x2:
      if (place >= limits.width) return false;
      Store(held->time_us | static_cast<uint64_t>(place) << 32 | held->row |
                static_cast<uint64_t>(word & 0x800) << 52,
            *to);
      ++*to;
      return true;
    case 0x3:
      held->base = place << 1 | (word >> 11 & 1);
      return true;
    case 0x4:
      return TakeVector<12>(word, limits, held, to);
    case 0x5:
      return TakeVector<8>(word, limits, held, to);
    case 0x6:
      held->time_us = limits.high_us | (word & 0xfff);
      return true;
    case 0x7:
    case 0xE:
    case 0xF:
      return true;
    default:
      return word == limits.known_high;
  }
}

// What follows a base: a branch of its own is foretold better.
const uint8_t* TakeVectors(const uint8_t* at, const uint8_t* stop, const Evt3State& limits,
                           Held* held, PackedEvent** to) {
  while (at < stop) {
    const uint32_t word = Load<uint16_t>(at);
    if (word >> 12 == 0x4) {
      if (!TakeVector<12>(word, limits, held, to)) break;
    } else if (word >> 12 == 0x5) {
      if (!TakeVector<8>(word, limits, held, to)) break;
    } else {
      break;
    }
    at += 2;
  }
  return at;
}

// Most events are a row and a column: those two words are taken together.
bool IsRowAndColumn(uint32_t words) { return (words & 0xf000f000) == 0x20000000; }
bool IsRowAndBase(uint32_t words) { return (words & 0xf000f000) == 0x30000000; }

Evt3Kernel::Position DecodePortable(Evt3Kernel::Position from, const uint8_t* end,
                                    const PackedEvent* full, Evt3State* state) {
  const Evt3State limits = *state;
  Held held{.time_us = limits.high_us | limits.time_low,
            .row = static_cast<uint64_t>(limits.y) << 48,
            .base = limits.base};
  const uint8_t* at = from.at;
  PackedEvent* to = from.to;
  bool goes_on = true;
  while (goes_on && static_cast<size_t>(end - at) >= 2 * Evt3Kernel::kBlockWords && to < full) {
    const uint8_t* const stop = at + 2 * (Evt3Kernel::kBlockWords - 1);
    while (at < stop) {
      const uint32_t words = Load<uint32_t>(at);
      const uint32_t y = words & 0x7ff, x = words >> 16 & 0x7ff;
      if (IsRowAndColumn(words) && y < limits.height && x < limits.width) [[likely]] {
        held.row = static_cast<uint64_t>(y) << 48;
        Store(held.time_us | static_cast<uint64_t>(x) << 32 | held.row |
                  static_cast<uint64_t>(words & 0x8000000) << 36,
              to);
        ++to;
        at += 4;
        continue;
      }
      if (IsRowAndBase(words) && y < limits.height) {
        held.row = static_cast<uint64_t>(y) << 48;
        held.base = x << 1 | (words >> 27 & 1);
        at = TakeVectors(at + 4, stop, limits, &held, &to);
        continue;
      }
      goes_on = Take(words & 0xffff, limits, &held, &to);
      if (!goes_on) break;
      at += 2;
    }
  }
  state->y = static_cast<uint32_t>(held.row >> 48);
  state->base = held.base;
  state->time_low = static_cast<uint32_t>(held.time_us) - limits.high_us;
  return {at, to};
}

}  // namespace

extern const Evt3Kernel kPortableEvt3Kernel;
const Evt3Kernel kPortableEvt3Kernel = {"portable", &DecodePortable};

}  // namespace rigcal::agent
