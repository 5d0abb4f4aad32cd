// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>

#include "agent/event/event.h"
#include "agent/event/time_high.h"

namespace rigcal::agent {

// Decoders of Prophesee's formats, after docs.prophesee.ai "Data encoding formats" (EVT 2.0, 2.1,
// 3.0). Each keeps its state from one chunk to the next and hands what it reads to a sink, whose
// functions are inlined into the decoder's loop, so that decoding and filtering are one pass:
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

// 16-bit words; a row, a time and a base column hold until they are told anew.
class Evt3Decoder {
 public:
  static constexpr EventFormat kFormat = EventFormat::kEvt3;
  static constexpr size_t kWordBytes = 2;

  explicit Evt3Decoder(SensorGeometry geometry) : geometry_(geometry) {}

  const EventFaults& faults() const { return faults_; }
  int64_t time_us() const { return time_high_.time_us() + time_low_; }

  template <typename Sink>
  void Decode(std::span<const uint8_t> bytes, Sink& sink);

 private:
  enum Type : uint32_t {
    kAddressY = 0x0,
    kAddressX = 0x2,
    kVectorBase = 0x3,
    kVector12 = 0x4,
    kVector8 = 0x5,
    kTimeLow = 0x6,
    kContinued4 = 0x7,
    kTimeHigh = 0x8,
    kExternalTrigger = 0xA,
    kOthers = 0xE,
    kContinued12 = 0xF,
  };

  template <typename Sink>
  void TakeTimeHigh(uint32_t value, const uint8_t* rest, const uint8_t* end, Sink& sink);
  void CountUnplaced(uint64_t count) {
    (time_high_.known() ? faults_.outside_geometry : faults_.before_time) += count;
  }

  static constexpr uint32_t kFarColumn = 1u << 30;

  SensorGeometry geometry_;
  EventFaults faults_;
  TimeHigh<12, 12> time_high_;
  int64_t high_us_ = 0;
  uint32_t time_low_ = 0;
  uint32_t y_ = 0;
  bool row_ok_ = false;
  uint32_t base_x_ = 0;
  bool base_on_ = false;
};

template <typename Sink>
void Evt3Decoder::TakeTimeHigh(uint32_t value, const uint8_t* rest, const uint8_t* end,
                               Sink& sink) {
  const auto find_next = [rest, end]() -> std::optional<uint32_t> {
    for (const uint8_t* at = rest; at != end; at += kWordBytes) {
      const uint32_t word = event_words::Load<uint16_t>(at);
      if (word >> 12 == kTimeHigh) return word & 0xfff;
    }
    return std::nullopt;
  };
  const uint64_t steps_back = faults_.time_steps_back;
  if (!event_words::TakeTimeHigh(value, find_next, &time_high_, &faults_, sink)) return;
  if (faults_.time_steps_back != steps_back) time_low_ = 0;
  high_us_ = time_high_.time_us();
}

template <typename Sink>
void Evt3Decoder::Decode(std::span<const uint8_t> bytes, Sink& sink) {
  const uint8_t* at = bytes.data();
  const uint8_t* const end = at + bytes.size() / kWordBytes * kWordBytes;
  faults_.truncated_bytes += bytes.size() % kWordBytes;
  // What every event needs stands in variables that no store of the sink can touch. `width` is that
  // of the rows that events can be placed in, or 0 where they cannot.
  uint32_t y = y_, base_x = base_x_, base_on = base_on_ ? 1 : 0;
  uint32_t now = static_cast<uint32_t>(high_us_) + time_low_;
  uint32_t width = row_ok_ && time_high_.known() ? geometry_.width : 0;
  const uint32_t full_width = geometry_.width, height = geometry_.height;
  for (; at != end; at += kWordBytes) {
    const uint32_t word = event_words::Load<uint16_t>(at);
    switch (word >> 12) {
      case kAddressX: {
        const uint32_t x = word & 0x7ff;
        if (x < width) {
          sink.Event(x, y, (word & 0x800) != 0, now);
        } else {
          CountUnplaced(1);
        }
        break;
      }
      case kAddressY:
        y = word & 0x7ff;
        row_ok_ = y < height;
        width = row_ok_ && time_high_.known() ? full_width : 0;
        if (row_ok_) sink.Row(y);
        break;
      case kVectorBase:
        base_x = word & 0x7ff;
        base_on = word >> 11 & 1;
        break;
      case kVector12:
      case kVector8: {
        const uint32_t length = word >> 12 == kVector12 ? 12 : 8;
        uint32_t mask = word & ((1u << length) - 1);
        const uint32_t x = base_x;
        base_x += length;
        if (x + length > width) {
          const uint32_t inside = x >= width ? 0 : (1u << (width - x)) - 1;
          CountUnplaced(static_cast<uint64_t>(std::popcount(mask & ~inside)));
          mask &= inside;
          // Vectors without end must not come round to the first column.
          base_x = std::min(base_x, kFarColumn);
        }
        if (mask != 0) sink.Vector(x, y, base_on != 0, now, mask);
        break;
      }
      case kTimeLow:
        time_low_ = word & 0xfff;
        now = static_cast<uint32_t>(high_us_) + time_low_;
        break;
      case kTimeHigh:
        TakeTimeHigh(word & 0xfff, at + kWordBytes, end, sink);
        now = static_cast<uint32_t>(high_us_) + time_low_;
        width = row_ok_ ? full_width : 0;
        break;
      case kExternalTrigger:
        if (time_high_.known()) {
          sink.Trigger(TriggerEvent{.time_us = high_us_ + time_low_,
                                    .channel = static_cast<uint8_t>(word >> 8 & 0xf),
                                    .rising = (word & 1) != 0});
        } else {
          ++faults_.before_time;
        }
        break;
      case kOthers:
      case kContinued4:
      case kContinued12:
        break;
      default:
        ++faults_.unknown_words;
    }
  }
  y_ = y;
  base_x_ = base_x;
  base_on_ = base_on != 0;
}

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
