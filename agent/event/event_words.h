// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <optional>

#include "agent/event/event.h"

namespace rigcal::agent {

// Decoders of Prophesee's formats, after docs.prophesee.ai "Data encoding formats" (EVT 2.0, 2.1,
// 3.0). Each keeps its state from one chunk to the next and hands what it reads to a sink, whose
// functions are inlined into the decoder's loop. Where speed counts DecodeInBatches(decoder, bytes,
// consumer) is the better way (event_batcher.h). A sink:
//
//   void Row(uint32_t y)            the row of what follows (EVT 3.0: not repeated for each event)
//   void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us)
//   void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask)
//                                   bit k of mask: pixel x + k; never 0, never outside the geometry
//   void Trigger(const TriggerEvent&)
//   void TimeStepBack(int64_t time_us)   the clock now begins anew at this time: a new epoch
//
// Event times are the lower 32 bits of the sensor's microseconds with overflows taken out;
// time_us() has all 64. Every damaged word is counted and skipped; nothing read is outside the
// geometry.
struct SensorGeometry {
  uint32_t width = 0;
  uint32_t height = 0;
  friend bool operator==(const SensorGeometry&, const SensorGeometry&) = default;
};

namespace event_words {

template <typename Word>
Word Load(const uint8_t* bytes) {
  static_assert(std::endian::native == std::endian::little);
  Word word;
  std::memcpy(&word, bytes, sizeof(word));
  return word;
}

// Takes a TIME_HIGH word that may be a gap, a restart or damage; find_next() looks ahead for the
// one behind it. False: damaged, and nothing has changed.
template <typename High, typename FindNext, typename Sink>
bool TakeTimeHigh(uint32_t value, FindNext find_next, High* high, EventFaults* faults, Sink& sink) {
  if (high->Take(value) == High::Verdict::kGoesOn) return true;
  const std::optional<uint32_t> next = find_next();
  switch (high->Decide(value, next ? &*next : nullptr)) {
    case High::Change::kDamaged:
      ++faults->unknown_words;
      return false;
    case High::Change::kStepBack:
      ++faults->time_steps_back;
      sink.TimeStepBack(high->time_us());
      break;
    case High::Change::kGap:
      break;
  }
  return true;
}

}  // namespace event_words

}  // namespace rigcal::agent
