// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "agent/event/any_event_decoder.h"

namespace rigcal::agent {

// Follows the time of an encoded stream exactly as its decoder does.
class EventTimer {
 public:
  explicit EventTimer(AnyEventDecoder decoder) : decoder_(std::move(decoder)) {}

  // The next whole words.
  void Take(std::span<const uint8_t> bytes) {
    NoSink sink;
    std::visit([&](auto& decoder) { decoder.Decode(bytes, sink); }, decoder_);
  }
  // Of the sensor's clock behind the last word, overflows taken out.
  int64_t time_us() const {
    return std::visit([](const auto& decoder) { return decoder.time_us(); }, decoder_);
  }

 private:
  struct NoSink {
    void Event(uint32_t, uint32_t, bool, uint32_t) {}
    void Vector(uint32_t, uint32_t, bool, uint32_t, uint32_t) {}
    void Trigger(const TriggerEvent&) {}
    void TimeStepBack(int64_t) {}
  };
  AnyEventDecoder decoder_;
};

}  // namespace rigcal::agent
