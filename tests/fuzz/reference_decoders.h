// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "agent/event/event_decoder.h"
#include "agent/event/time_high.h"
#include "tests/fuzz/decoded_stream.h"

namespace rigcal::testing {

// The three formats once more, word by word and pixel by pixel, as plainly as it can be written:
// what the decoders tell must be the same. Only the meaning of a doubtful TIME_HIGH word is theirs
// (time_high.h).
template <typename Word>
std::vector<Word> WordsOf(std::span<const uint8_t> bytes) {
  std::vector<Word> words(bytes.size() / sizeof(Word));
  if (!words.empty()) std::memcpy(words.data(), bytes.data(), words.size() * sizeof(Word));
  return words;
}

template <typename High>
class ReferenceDecoder {
 public:
  explicit ReferenceDecoder(agent::SensorGeometry geometry) : geometry_(geometry) {}
  DecodedStream result;
  // Words (by index) after which a cut changes nothing: no doubtful TIME_HIGH waits for the next
  // one.
  std::vector<bool> cut_is_safe;

 protected:
  // `next`: value of the next TIME_HIGH word and its index. True: the time has changed.
  struct Next {
    size_t index;
    uint32_t value;
  };
  bool TakeHigh(size_t index, uint32_t value, std::optional<Next> next) {
    if (high_.Take(value)) return true;
    if (next) {
      for (size_t i = index; i < next->index; ++i) cut_is_safe[i] = false;
    }
    switch (high_.Decide(value, next ? &next->value : nullptr)) {
      case High::Change::kDamaged:
        ++result.faults.unknown_words;
        return false;
      case High::Change::kStepBack:
        ++result.faults.time_steps_back;
        result.told.push_back({.kind = Told::Kind::kStepBack, .time_us = high_.time_us()});
        low_us_ = 0;
        return true;
      case High::Change::kNone:
      case High::Change::kGap:
        return true;
    }
    return true;
  }
  void Pixel(uint32_t x, uint32_t y, bool on) {
    if (!high_.known()) {
      ++result.faults.before_time;
    } else if (x >= geometry_.width || y >= geometry_.height) {
      ++result.faults.outside_geometry;
    } else {
      result.told.push_back({Told::Kind::kPixel, x, y, on, static_cast<uint32_t>(TimeUs())});
    }
  }
  void Trigger(uint32_t channel, bool rising) {
    if (!high_.known()) {
      ++result.faults.before_time;
    } else {
      result.told.push_back({Told::Kind::kTrigger, channel, 0, rising, TimeUs()});
    }
  }
  int64_t TimeUs() const { return high_.time_us() + low_us_; }

  agent::SensorGeometry geometry_;
  High high_;
  uint32_t low_us_ = 0;
};

class ReferenceEvt3 : public ReferenceDecoder<agent::TimeHigh<12, 12>> {
 public:
  using ReferenceDecoder::ReferenceDecoder;

  void Decode(std::span<const uint8_t> bytes) {
    const std::vector<uint16_t> words = WordsOf<uint16_t>(bytes);
    cut_is_safe.assign(words.size(), true);
    result.faults.truncated_bytes = bytes.size() % 2;
    for (size_t i = 0; i < words.size(); ++i) {
      const uint32_t value = words[i] & 0xfffu;
      switch (words[i] >> 12) {
        case 0x0:
          y_ = value & 0x7ff;
          break;
        case 0x2:
          Pixel(value & 0x7ff, y_, (value & 0x800) != 0);
          break;
        case 0x3:
          x_ = value & 0x7ff;
          on_ = (value & 0x800) != 0;
          break;
        case 0x4:
          Pixels(value, 12);
          break;
        case 0x5:
          Pixels(value & 0xff, 8);
          break;
        case 0x6:
          low_us_ = value;
          break;
        case 0x8: {
          std::optional<Next> next;
          for (size_t k = i + 1; k < words.size() && !next; ++k) {
            if (words[k] >> 12 == 0x8) next = {k, words[k] & 0xfffu};
          }
          TakeHigh(i, value, next);
          break;
        }
        case 0xA:
          Trigger(value >> 8, (value & 1) != 0);
          break;
        case 0x7:
        case 0xE:
        case 0xF:
          break;
        default:
          ++result.faults.unknown_words;
      }
    }
    result.time_us = TimeUs();
  }

 private:
  // Pixels before the first row word have no row.
  static constexpr uint32_t kNoRow = 0xffff;

  void Pixels(uint32_t mask, uint32_t count) {
    for (uint32_t k = 0; k < count; ++k) {
      if ((mask >> k & 1) != 0) Pixel(x_ + k, y_, on_);
    }
    x_ += count;
  }

  uint32_t x_ = 0, y_ = kNoRow;
  bool on_ = false;
};

// EVT 2.0 and 2.1: type in the upper 4 bits, the next 6 are the lower ones of the time, or 28 the
// upper ones.
class ReferenceEvt2 : public ReferenceDecoder<agent::TimeHigh<28, 6>> {
 public:
  using ReferenceDecoder::ReferenceDecoder;

  void Decode(std::span<const uint8_t> bytes) {
    const std::vector<uint32_t> words = WordsOf<uint32_t>(bytes);
    result.faults.truncated_bytes = bytes.size() % 4;
    DecodeHalves(words, {});
  }
  void Decode21(std::span<const uint8_t> bytes, bool halves_swapped) {
    std::vector<uint32_t> upper, lower;
    for (const uint64_t word : WordsOf<uint64_t>(bytes)) {
      upper.push_back(static_cast<uint32_t>(word >> (halves_swapped ? 0 : 32)));
      lower.push_back(static_cast<uint32_t>(word >> (halves_swapped ? 32 : 0)));
    }
    result.faults.truncated_bytes = bytes.size() % 8;
    DecodeHalves(upper, lower);
  }

 private:
  // `masks`: the pixels from x on; empty in EVT 2.0.
  void DecodeHalves(const std::vector<uint32_t>& words, const std::vector<uint32_t>& masks) {
    cut_is_safe.assign(words.size(), true);
    for (size_t i = 0; i < words.size(); ++i) {
      const uint32_t word = words[i];
      low_us_ = word >> 22 & 0x3f;
      switch (word >> 28) {
        case 0x0:
        case 0x1:
          for (uint32_t k = 0; k < 32; ++k) {
            if (((masks.empty() ? 1u : masks[i]) >> k & 1) == 0) continue;
            Pixel((word >> 11 & 0x7ff) + k, word & 0x7ff, word >> 28 == 1);
          }
          break;
        case 0x8: {
          std::optional<Next> next;
          for (size_t k = i + 1; k < words.size() && !next; ++k) {
            if (words[k] >> 28 == 0x8) next = {k, words[k] & 0xfffffffu};
          }
          TakeHigh(i, word & 0xfffffff, next);
          break;
        }
        case 0xA:
          Trigger(word >> 8 & 0x1f, (word & 1) != 0);
          break;
        case 0xE:
        case 0xF:
          break;
        default:
          ++result.faults.unknown_words;
      }
    }
    low_us_ = 0;
    result.time_us = TimeUs();
  }
};

}  // namespace rigcal::testing
