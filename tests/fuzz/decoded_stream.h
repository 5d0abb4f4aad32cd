// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "agent/event/event_decoder.h"
#include "tests/fuzz/fuzz_check.h"

namespace rigcal::testing {

// What a decoder told, one after the other; vectors taken apart from the left.
struct Told {
  enum class Kind : uint8_t { kPixel, kTrigger, kStepBack };
  Kind kind = Kind::kPixel;
  uint32_t x = 0;  // for a trigger, its channel
  uint32_t y = 0;
  bool on = false;      // for a trigger: rising
  int64_t time_us = 0;  // for a pixel, the lower 32 bits
  friend bool operator==(const Told&, const Told&) = default;
};

struct DecodedStream {
  std::vector<Told> told;
  agent::EventFaults faults;
  int64_t time_us = 0;  // at the end
  friend bool operator==(const DecodedStream&, const DecodedStream&) = default;
};

// A sink that checks what event_decoder.h promises of each call.
class CheckingSink {
 public:
  explicit CheckingSink(agent::SensorGeometry geometry) : geometry_(geometry) {}

  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) {
    FUZZ_CHECK(x < geometry_.width && y < geometry_.height);
    told_.push_back({Told::Kind::kPixel, x, y, on, time_us});
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    FUZZ_CHECK(mask != 0);
    FUZZ_CHECK(x < geometry_.width);
    FUZZ_CHECK(x + 31 - static_cast<uint32_t>(std::countl_zero(mask)) < geometry_.width);
    for (; mask != 0; mask &= mask - 1) {
      Event(x + static_cast<uint32_t>(std::countr_zero(mask)), y, on, time_us);
    }
  }
  void Trigger(const agent::TriggerEvent& trigger) {
    FUZZ_CHECK(trigger.time_us >= 0 && trigger.channel < 32);
    told_.push_back({Told::Kind::kTrigger, trigger.channel, 0, trigger.rising, trigger.time_us});
  }
  void TimeStepBack(int64_t time_us) {
    FUZZ_CHECK(time_us >= 0);
    told_.push_back({.kind = Told::Kind::kStepBack, .time_us = time_us});
  }

  std::vector<Told> TakeTold() { return std::move(told_); }

 private:
  const agent::SensorGeometry geometry_;
  std::vector<Told> told_;
};

// The same for what takes events in batches (event_batcher.h).
class CheckingConsumer {
 public:
  explicit CheckingConsumer(agent::SensorGeometry geometry) : sink_(geometry) {}

  void Events(std::span<const agent::PackedEvent> events) {
    FUZZ_CHECK(!events.empty());
    for (const agent::PackedEvent& event : events) {
      sink_.Event(event.x, event.y(), event.on(), event.time_us);
    }
  }
  void Trigger(const agent::TriggerEvent& trigger) { sink_.Trigger(trigger); }
  void TimeStepBack(int64_t time_us) { sink_.TimeStepBack(time_us); }

  std::vector<Told> TakeTold() { return sink_.TakeTold(); }

 private:
  CheckingSink sink_;
};

}  // namespace rigcal::testing
