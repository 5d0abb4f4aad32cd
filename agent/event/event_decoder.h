// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>
#include <optional>

#include "agent/event/evt3_decoder.h"
#include "agent/event/time_high.h"

namespace rigcal::agent {

// EVT 2.0: words of 32 bits, each an event by itself. EVT 2.1: words of 64 bits, whose upper half
// is a word of EVT 2.0 and the lower half a mask of the pixels from there on.
template <typename Word>
class Evt2xDecoder : public WordDecoder<Evt2xDecoder<Word>, Word> {
  using Base = WordDecoder<Evt2xDecoder, Word>;

 public:
  static constexpr bool kHasMask = sizeof(Word) == 8;

  // `halves_swapped`: the upper 32 bits of a word come first, as an IMX636 sends EVT 2.1
  // ("endianness=legacy").
  explicit Evt2xDecoder(SensorGeometry geometry, bool halves_swapped = false)
      : Base(geometry), rotation_(halves_swapped ? 32 : 0) {}

  int64_t time_us() const { return time_high_.time_us(); }

 private:
  friend Base;
  static constexpr uint32_t kTimeHigh = 0x8;

  Word Load(const uint8_t* at) const { return std::rotl(LoadWord<Word>(at), rotation_); }
  static uint32_t HeadOf(Word word) { return static_cast<uint32_t>(word >> (kHasMask ? 32 : 0)); }
  std::optional<uint32_t> TimeOf(Word word) const {
    const uint32_t head = HeadOf(word);
    if (head >> 28 != kTimeHigh) return std::nullopt;
    return head & 0xfffffff;
  }

  template <typename Sink>
  void Take(Word word, const uint8_t* rest, const uint8_t* end, Sink& sink) {
    const uint32_t head = HeadOf(word);
    switch (head >> 28) {
      case 0x0:
      case 0x1:
        TakeEvents(head, kHasMask ? static_cast<uint32_t>(word) : 1, sink);
        break;
      case kTimeHigh: {
        const auto change = this->TakeTimeHigh(head & 0xfffffff, rest, end, &time_high_);
        high_us_ = time_high_.time_us();
        if (change == High::Change::kStepBack) sink.TimeStepBack(high_us_);
        break;
      }
      case 0xA:
        if (time_high_.known()) {
          sink.Trigger(TriggerEvent{.time_us = high_us_ + (head >> 22 & 0x3f),
                                    .channel = static_cast<uint8_t>(head >> 8 & 0x1f),
                                    .rising = (head & 1) != 0});
        } else {
          ++this->faults_.before_time;
        }
        break;
      case 0xE:
      case 0xF:
        break;
      default:
        ++this->faults_.unknown_words;
    }
  }

  template <typename Sink>
  void TakeEvents(uint32_t head, uint32_t mask, Sink& sink) {
    const SensorGeometry& geometry = this->geometry_;
    const uint32_t x = head >> 11 & 0x7ff, y = head & 0x7ff;
    if (!time_high_.known()) {
      this->faults_.before_time += static_cast<uint64_t>(std::popcount(mask));
      return;
    }
    uint32_t inside = 0xffffffff;
    if (y >= geometry.height || x >= geometry.width) {
      inside = 0;
    } else if (x + 32 > geometry.width) {
      inside = (1u << (geometry.width - x)) - 1;
    }
    this->faults_.outside_geometry += static_cast<uint64_t>(std::popcount(mask & ~inside));
    mask &= inside;
    if (mask == 0) return;
    const uint32_t time_us = static_cast<uint32_t>(high_us_) + (head >> 22 & 0x3f);
    if constexpr (kHasMask) {
      sink.Vector(x, y, head >> 28 == 1, time_us, mask);
    } else {
      sink.Event(x, y, head >> 28 == 1, time_us);
    }
  }

  using High = TimeHigh<28, 6>;

  int rotation_;
  High time_high_;
  int64_t high_us_ = 0;
};

using Evt2Decoder = Evt2xDecoder<uint32_t>;
using Evt21Decoder = Evt2xDecoder<uint64_t>;

}  // namespace rigcal::agent
