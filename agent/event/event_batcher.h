// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "agent/event/event.h"

namespace rigcal::agent {

// A sink of the event decoders that collects events and hands them on many at a time, from a buffer
// that stays in the CPU's first cache. Events, triggers and steps of the clock reach the consumer
// in the order of the stream:
//
//   void Events(std::span<const PackedEvent>)   never empty; times as in event_decoder.h
//   void Trigger(const TriggerEvent&)
//   void TimeStepBack(int64_t time_us)
//
// Flush() at the end.
template <typename Consumer>
class EventBatcher {
 public:
  static constexpr size_t kEvents = 1024;
  static constexpr size_t kRoomEvents = 256;  // that may be written behind full()

  static_assert(kRoomEvents >= 32 + 12);  // a vector's pixels, and what a short run writes beyond

  explicit EventBatcher(Consumer* consumer) : consumer_(*consumer) {}
  EventBatcher(const EventBatcher&) = delete;
  EventBatcher& operator=(const EventBatcher&) = delete;

  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) {
    *to_++ = {time_us, static_cast<uint16_t>(x), static_cast<uint16_t>(y | (on ? 0x8000u : 0u))};
    if (to_ >= full()) [[unlikely]]
      Flush();
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    const auto y_polarity = static_cast<uint16_t>(y | (on ? 0x8000u : 0u));
    const auto event_at = [=](uint32_t column) {
      return PackedEvent{time_us, static_cast<uint16_t>(column), y_polarity};
    };
    // Most vectors are one short run of pixels: no branch for each.
    const auto first = static_cast<uint32_t>(std::countr_zero(mask));
    const uint32_t run = mask >> first;
    if ((run & (run + 1)) == 0 && run < 1u << kShortRun) [[likely]] {
      for (uint32_t k = 0; k < kShortRun; ++k) to_[k] = event_at(x + first + k);
      to_ += std::countr_one(run);
    } else {
      for (; mask != 0; mask &= mask - 1) {
        *to_++ = event_at(x + static_cast<uint32_t>(std::countr_zero(mask)));
      }
    }
    if (to_ >= full()) [[unlikely]]
      Flush();
  }
  void Trigger(const TriggerEvent& trigger) {
    Flush();
    consumer_.Trigger(trigger);
  }
  void TimeStepBack(int64_t time_us) {
    Flush();
    consumer_.TimeStepBack(time_us);
  }

  void Flush() {
    const auto count = static_cast<size_t>(to_ - buffer_.data());
    to_ = buffer_.data();
    if (count != 0) consumer_.Events(std::span<const PackedEvent>(buffer_.data(), count));
  }

  // For those that write events themselves: where the next one goes.
  PackedEvent* to() { return to_; }
  const PackedEvent* full() const { return buffer_.data() + kEvents; }
  void Wrote(PackedEvent* to) {
    to_ = to;
    if (to_ >= full()) Flush();
  }

 private:
  static constexpr uint32_t kShortRun = 12;  // pixels

  Consumer& consumer_;
  PackedEvent* to_ = buffer_.data();
  alignas(64) std::array<PackedEvent, kEvents + kRoomEvents> buffer_;
};

// Decodes as decoder.Decode does, in batches.
template <typename Decoder, typename Consumer>
void DecodeInBatches(Decoder& decoder, std::span<const uint8_t> bytes, Consumer& consumer) {
  EventBatcher<Consumer> batcher(&consumer);
  decoder.Decode(bytes, batcher);
  batcher.Flush();
}

}  // namespace rigcal::agent
