// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "agent/event/event.h"

namespace rigcal::agent {

// Holds from one EVT 3.0 word to the next while the time is known and the row is one of the
// sensor's.
struct Evt3State {
  uint32_t width = 0;  // of the sensor, at most kMaxWidth
  uint32_t height = 0;
  uint32_t y = 0;
  uint32_t base = 0;  // of vectors: column * 2 + (brighter ? 1 : 0), at most kMaxBase
  uint32_t time_low = 0;
  uint32_t high_us = 0;     // lower 32 bits
  uint32_t known_high = 0;  // the TIME_HIGH word that repeats the time

  static constexpr uint32_t kMaxWidth = 2048;
  static constexpr uint32_t kMaxBase = 8191;
};

// EVT 3.0 words to events, compiled for several instruction sets, all with the same result as
// Evt3Decoder::Decode, word by word, for the words that a stream consists of. Damage, triggers and
// new TIME_HIGH words are left to that; so is all where `decode` is null (the portable one).
struct Evt3Kernel {
  static constexpr size_t kBlockWords = 16;
  // Of one block; so many events behind `full` may be written to.
  static constexpr size_t kBlockEvents = 16 * 12;
  static constexpr size_t kRoomEvents = kBlockEvents + 16;

  struct Position {
    const uint8_t* at;
    PackedEvent* to;
  };

  const char* name;

  // Stops at the first of: less than a block before `end`; `to` has reached `full`; a word among
  // the next kBlockWords that is left to Evt3Decoder::Decode.
  Position (*decode)(Position from, const uint8_t* end, const PackedEvent* full, Evt3State* state);
};

// The fastest that this CPU can run; all that it can run, the portable one first.
const Evt3Kernel& BestEvt3Kernel();
std::vector<const Evt3Kernel*> AvailableEvt3Kernels();

}  // namespace rigcal::agent
