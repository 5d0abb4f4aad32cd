// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>

#include "agent/event/event.h"

namespace rigcal::agent {

// Decoders of Prophesee's formats, after docs.prophesee.ai "Data encoding formats" (EVT 2.0, 2.1,
// 3.0). Each keeps its state from one chunk to the next and hands what it reads to a sink, whose
// functions are inlined into the decoder's loop. Where speed counts DecodeInBatches(decoder, bytes,
// consumer) is the better way (event_batcher.h). A sink:
//
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

template <typename Word>
Word LoadWord(const uint8_t* bytes) {
  static_assert(std::endian::native == std::endian::little);
  Word word;
  std::memcpy(&word, bytes, sizeof(word));
  return word;
}

// The walk over the words of a chunk, shared by all decoders. A `Decoder` derives from it and has
//
//   Word Load(const uint8_t*) const
//   std::optional<...> TimeOf(Word) const   of words whose time is believed only with the next one
//   void Take(Word, const uint8_t* rest, const uint8_t* end, Sink&)   `rest`: behind the word
template <typename Decoder, typename WordType>
class WordDecoder {
 public:
  using Word = WordType;
  static constexpr size_t kWordBytes = sizeof(Word);

  explicit WordDecoder(SensorGeometry geometry) : geometry_(geometry) {}

  const EventFaults& faults() const { return faults_; }

  template <typename Sink>
  void Decode(std::span<const uint8_t> bytes, Sink& sink) {
    const std::span<const uint8_t> whole = WholeWords(bytes);
    const uint8_t* const end = whole.data() + whole.size();
    self().DecodeWords(whole.data(), end, end, sink);
  }

  // Decode may look ahead to the next such word before it believes this one.
  bool AsksAhead(const uint8_t* word) const { return self().TimeOf(self().Load(word)).has_value(); }

  Word Load(const uint8_t* bytes) const { return LoadWord<Word>(bytes); }

  // From `at` to `stop`; may look ahead to `end`.
  template <typename Sink>
  void DecodeWords(const uint8_t* at, const uint8_t* stop, const uint8_t* end, Sink& sink) {
    for (; at != stop; at += kWordBytes) {
      self().Take(self().Load(at), at + kWordBytes, end, sink);
    }
  }

 protected:
  std::span<const uint8_t> WholeWords(std::span<const uint8_t> bytes) {
    faults_.truncated_bytes += bytes.size() % kWordBytes;
    return bytes.first(bytes.size() / kWordBytes * kWordBytes);
  }

  // Takes a TIME_HIGH word that may be a gap, a restart or damage: the one behind it decides.
  template <typename High>
  typename High::Change TakeTimeHigh(uint32_t value, const uint8_t* rest, const uint8_t* end,
                                     High* high) {
    if (high->Take(value)) return High::Change::kNone;
    const auto next = FindTime(rest, end);
    const auto change = high->Decide(value, next ? &*next : nullptr);
    if (change == High::Change::kDamaged) ++faults_.unknown_words;
    if (change == High::Change::kStepBack) ++faults_.time_steps_back;
    return change;
  }

  // Of the first word from `at` on that has one.
  auto FindTime(const uint8_t* at, const uint8_t* end) const {
    decltype(self().TimeOf(Word{})) time;
    for (; at != end && !time; at += kWordBytes) time = self().TimeOf(self().Load(at));
    return time;
  }

  SensorGeometry geometry_;
  EventFaults faults_;

 private:
  Decoder& self() { return static_cast<Decoder&>(*this); }
  const Decoder& self() const { return static_cast<const Decoder&>(*this); }
};

}  // namespace rigcal::agent
