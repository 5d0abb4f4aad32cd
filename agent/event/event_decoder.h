// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>
#include <optional>
#include <span>

#include "agent/event/event.h"
#include "agent/event/event_words.h"
#include "agent/event/evt3_decoder.h"
#include "agent/event/time_high.h"

namespace rigcal::agent {

// 32-bit words, each event by itself.
class Evt2Decoder {
 public:
  static constexpr EventFormat kFormat = EventFormat::kEvt2;
  static constexpr size_t kWordBytes = 4;

  explicit Evt2Decoder(SensorGeometry geometry) : geometry_(geometry) {}

  const EventFaults& faults() const { return faults_; }
  int64_t time_us() const { return time_high_.time_us(); }

  template <typename Sink>
  void Decode(std::span<const uint8_t> bytes, Sink& sink) {
    const uint8_t* at = bytes.data();
    const uint8_t* const end = at + bytes.size() / kWordBytes * kWordBytes;
    faults_.truncated_bytes += bytes.size() % kWordBytes;
    for (; at != end; at += kWordBytes) {
      const uint32_t word = event_words::Load<uint32_t>(at);
      switch (word >> 28) {
        case 0x0:
        case 0x1: {
          const uint32_t x = word >> 11 & 0x7ff, y = word & 0x7ff;
          if (!time_high_.known()) {
            ++faults_.before_time;
          } else if (x < geometry_.width && y < geometry_.height) {
            sink.Event(x, y, word >> 28 == 1,
                       static_cast<uint32_t>(high_us_) + (word >> 22 & 0x3f));
          } else {
            ++faults_.outside_geometry;
          }
          break;
        }
        case 0x8:
          TakeTimeHigh(word & 0xfffffff, at + kWordBytes, end, sink);
          break;
        case 0xA:
          if (time_high_.known()) {
            sink.Trigger(TriggerEvent{.time_us = high_us_ + (word >> 22 & 0x3f),
                                      .channel = static_cast<uint8_t>(word >> 8 & 0x1f),
                                      .rising = (word & 1) != 0});
          } else {
            ++faults_.before_time;
          }
          break;
        case 0xE:
        case 0xF:
          break;
        default:
          ++faults_.unknown_words;
      }
    }
  }

 private:
  template <typename Sink>
  void TakeTimeHigh(uint32_t value, const uint8_t* rest, const uint8_t* end, Sink& sink) {
    const auto find_next = [rest, end]() -> std::optional<uint32_t> {
      for (const uint8_t* at = rest; at != end; at += kWordBytes) {
        const uint32_t word = event_words::Load<uint32_t>(at);
        if (word >> 28 == 0x8) return word & 0xfffffff;
      }
      return std::nullopt;
    };
    if (!event_words::TakeTimeHigh(value, find_next, &time_high_, &faults_, sink)) return;
    high_us_ = time_high_.time_us();
  }

  SensorGeometry geometry_;
  EventFaults faults_;
  TimeHigh<28, 6> time_high_;
  int64_t high_us_ = 0;
};

// 64-bit words: up to 32 pixels of one row and polarity each.
class Evt21Decoder {
 public:
  static constexpr EventFormat kFormat = EventFormat::kEvt21;
  static constexpr size_t kWordBytes = 8;

  // `halves_swapped`: the upper 32 bits of a word come first, as an IMX636 sends them
  // ("endianness=legacy").
  Evt21Decoder(SensorGeometry geometry, bool halves_swapped)
      : geometry_(geometry), rotation_(halves_swapped ? 32 : 0) {}

  const EventFaults& faults() const { return faults_; }
  int64_t time_us() const { return time_high_.time_us(); }

  template <typename Sink>
  void Decode(std::span<const uint8_t> bytes, Sink& sink) {
    const uint8_t* at = bytes.data();
    const uint8_t* const end = at + bytes.size() / kWordBytes * kWordBytes;
    faults_.truncated_bytes += bytes.size() % kWordBytes;
    for (; at != end; at += kWordBytes) {
      const uint64_t word = LoadWord(at);
      switch (word >> 60) {
        case 0x0:
        case 0x1:
          TakeEvents(word, sink);
          break;
        case 0x8:
          TakeTimeHigh(static_cast<uint32_t>(word >> 32) & 0xfffffff, at + kWordBytes, end, sink);
          break;
        case 0xA:
          if (time_high_.known()) {
            sink.Trigger(TriggerEvent{.time_us = high_us_ + static_cast<int64_t>(word >> 54 & 0x3f),
                                      .channel = static_cast<uint8_t>(word >> 40 & 0x1f),
                                      .rising = (word >> 32 & 1) != 0});
          } else {
            ++faults_.before_time;
          }
          break;
        case 0xE:
        case 0xF:
          break;
        default:
          ++faults_.unknown_words;
      }
    }
  }

 private:
  uint64_t LoadWord(const uint8_t* at) const {
    return std::rotl(event_words::Load<uint64_t>(at), rotation_);
  }

  template <typename Sink>
  void TakeEvents(uint64_t word, Sink& sink) {
    const uint32_t x = static_cast<uint32_t>(word >> 43) & 0x7ff;
    const uint32_t y = static_cast<uint32_t>(word >> 32) & 0x7ff;
    auto mask = static_cast<uint32_t>(word);
    if (mask == 0) return;
    if (!time_high_.known()) {
      faults_.before_time += static_cast<uint64_t>(std::popcount(mask));
      return;
    }
    uint32_t inside = 0xffffffff;
    if (y >= geometry_.height || x >= geometry_.width) {
      inside = 0;
    } else if (x + 32 > geometry_.width) {
      inside = (1u << (geometry_.width - x)) - 1;
    }
    faults_.outside_geometry += static_cast<uint64_t>(std::popcount(mask & ~inside));
    mask &= inside;
    if (mask == 0) return;
    sink.Vector(x, y, word >> 60 == 1,
                static_cast<uint32_t>(high_us_) + (static_cast<uint32_t>(word >> 54) & 0x3f), mask);
  }

  template <typename Sink>
  void TakeTimeHigh(uint32_t value, const uint8_t* rest, const uint8_t* end, Sink& sink) {
    const auto find_next = [this, rest, end]() -> std::optional<uint32_t> {
      for (const uint8_t* at = rest; at != end; at += kWordBytes) {
        const uint64_t word = LoadWord(at);
        if (word >> 60 == 0x8) return static_cast<uint32_t>(word >> 32) & 0xfffffff;
      }
      return std::nullopt;
    };
    if (!event_words::TakeTimeHigh(value, find_next, &time_high_, &faults_, sink)) return;
    high_us_ = time_high_.time_us();
  }

  SensorGeometry geometry_;
  int rotation_;
  EventFaults faults_;
  TimeHigh<28, 6> time_high_;
  int64_t high_us_ = 0;
};

}  // namespace rigcal::agent
