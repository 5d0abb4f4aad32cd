// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/event/plain_events.h"

namespace rigcal::testing {

// What a decoder of another program makes of the words of a RAW file: nothing of this project's
// decoders is used.
struct WordByWord {
  std::vector<agent::PlainEvent> events;  // and triggers
  std::string fault;                      // of the first word that is not understood; empty: none
};

// EVT 3.0 (docs.prophesee.ai, "EVT 3.0 Format") by a decoder that knows vectors only as 12, 12 and
// 8 columns behind their base, as OpenEB's default one does, and time only as a TIME_HIGH that
// overflows whenever it falls.
inline WordByWord DecodeEvt3ByThrees(std::span<const uint8_t> bytes) {
  using agent::PlainEvent;
  WordByWord result;
  int64_t overflows = 0, high = 0, low = 0;
  uint32_t y = 0, base = 0;
  bool on = false;
  const auto word = [&bytes](size_t i) {
    return static_cast<uint32_t>(bytes[2 * i] | bytes[2 * i + 1] << 8);
  };
  const auto time_us = [&] { return (overflows << 24) + (high << 12) + low; };
  const auto add = [&](uint32_t x) {
    result.events.push_back({.time_us = time_us(),
                             .x = static_cast<uint16_t>(x),
                             .y = static_cast<uint16_t>(y),
                             .kind = on ? PlainEvent::kOn : PlainEvent::kOff});
  };
  const size_t count = bytes.size() / 2;
  for (size_t i = 0; i < count; ++i) {
    const uint32_t value = word(i) & 0xfff;
    switch (word(i) >> 12) {
      case 0x0:
        y = value & 0x7ff;
        continue;
      case 0x2:
        on = (value & 0x800) != 0;
        add(value & 0x7ff);
        continue;
      case 0x3:
        on = (value & 0x800) != 0;
        base = value & 0x7ff;
        continue;
      case 0x4: {
        if (i + 2 >= count || word(i + 1) >> 12 != 0x4 || word(i + 2) >> 12 != 0x5) break;
        const uint32_t mask = value | (word(i + 1) & 0xfff) << 12 | (word(i + 2) & 0xff) << 24;
        for (uint32_t k = 0; k < 32; ++k) {
          if ((mask >> k & 1) != 0) add(base + k);
        }
        base += 32;
        i += 2;
        continue;
      }
      case 0x6:
        low = value;
        continue;
      case 0x8:
        overflows += value < high ? 1 : 0;
        high = value;
        continue;
      case 0xA:
        result.events.push_back(
            {.time_us = time_us(),
             .kind = (value & 1) != 0 ? PlainEvent::kTriggerRising : PlainEvent::kTriggerFalling,
             .channel = static_cast<uint8_t>(value >> 8)});
        continue;
      default:
        break;
    }
    result.fault = absl::StrCat("word ", i, " of ", count, " is ", word(i));
    return result;
  }
  return result;
}

// EVT 2.0 (docs.prophesee.ai, "EVT 2.0 Format").
inline WordByWord DecodeEvt2WordByWord(std::span<const uint8_t> bytes) {
  using agent::PlainEvent;
  WordByWord result;
  int64_t high = 0;
  for (size_t i = 0; i + 3 < bytes.size(); i += 4) {
    const uint32_t word = bytes[i] | static_cast<uint32_t>(bytes[i + 1]) << 8 |
                          static_cast<uint32_t>(bytes[i + 2]) << 16 |
                          static_cast<uint32_t>(bytes[i + 3]) << 24;
    const int64_t time_us = (high << 6) + (word >> 22 & 0x3f);
    switch (word >> 28) {
      case 0x0:
      case 0x1:
        result.events.push_back({.time_us = time_us,
                                 .x = static_cast<uint16_t>(word >> 11 & 0x7ff),
                                 .y = static_cast<uint16_t>(word & 0x7ff),
                                 .kind = word >> 28 == 1 ? PlainEvent::kOn : PlainEvent::kOff});
        continue;
      case 0x8:
        high = word & 0xfffffff;
        continue;
      case 0xA:
        result.events.push_back(
            {.time_us = time_us,
             .kind = (word & 1) != 0 ? PlainEvent::kTriggerRising : PlainEvent::kTriggerFalling,
             .channel = static_cast<uint8_t>(word >> 8 & 0x1f)});
        continue;
      default:
        result.fault = absl::StrCat("word at byte ", i, " is ", word);
        return result;
    }
  }
  return result;
}

}  // namespace rigcal::testing
