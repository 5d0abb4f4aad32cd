// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "agent/event/event_words.h"

namespace rigcal::agent {

// One record of a stream of EventFormat::kPlain: an event with its whole time, as files for
// interchange hold it. Sixteen bytes.
struct PlainEvent {
  enum Kind : uint8_t {
    kOff = 0,
    kOn = 1,
    kTriggerFalling = 2,
    kTriggerRising = 3,
    kUnreadable = 4,  // holds the place of a row that cannot be read
  };
  int64_t time_us = 0;
  uint16_t x = 0, y = 0;  // 65535: not a pixel of any sensor
  Kind kind = kOff;
  uint8_t channel = 0;  // of a trigger
  uint16_t reserved = 0;

  friend bool operator==(const PlainEvent&, const PlainEvent&) = default;
};
static_assert(sizeof(PlainEvent) == 16);

// Checks the times of plain records. Files that were merged or sorted by frame are out of order by
// some microseconds, which is allowed. A longer step back is a new clock epoch, as is a leap of
// more than 32 bits of microseconds; unless the next record continues from the last one: then this
// one is damaged.
class PlainClock {
 public:
  static constexpr int64_t kMaxUs = 9'000'000'000'000'000;  // 285 years, which are 63 bits of ns
  static constexpr int64_t kJitterUs = 1000;
  static constexpr int64_t kStepUs = int64_t{1} << 16;  // longer ones are checked by Decide
  static constexpr int64_t kLeapUs = int64_t{1} << 30;  // 18 minutes

  enum class Verdict : uint8_t { kGoesOn, kStepBack, kLeap, kDamaged };

  // The largest of this clock epoch.
  int64_t time_us() const { return time_us_; }

  // Takes a time that follows the last one without a gap. False: call Decide.
  bool Take(int64_t time_us) {
    if (!known_ || !Follows(time_us, time_us_)) return false;
    if (time_us > time_us_) time_us_ = time_us;
    return true;
  }
  // `next`: of the record behind this one, or nullptr where there is none to see. Nothing has
  // changed where the verdict is kDamaged.
  Verdict Decide(int64_t time_us, const int64_t* next) {
    const int64_t last_us = time_us_;
    if (known_ && next != nullptr && Follows(*next, last_us) && !Follows(*next, time_us)) {
      return Verdict::kDamaged;
    }
    time_us_ = time_us;
    if (!std::exchange(known_, true)) return Verdict::kGoesOn;
    if (time_us < last_us) return Verdict::kStepBack;
    const uint64_t ahead = static_cast<uint64_t>(time_us) - static_cast<uint64_t>(last_us);
    return ahead > static_cast<uint64_t>(kLeapUs) ? Verdict::kLeap : Verdict::kGoesOn;
  }

 private:
  static bool Follows(int64_t time_us, int64_t last_us) {
    return static_cast<uint64_t>(time_us) - static_cast<uint64_t>(last_us) +
               static_cast<uint64_t>(kJitterUs) <=
           static_cast<uint64_t>(kStepUs + kJitterUs);
  }

  int64_t time_us_ = 0;
  bool known_ = false;
};

// The record is an event or trigger, at a time that a recording can have.
inline bool IsReadable(const PlainEvent& event) {
  return event.kind < PlainEvent::kUnreadable && event.time_us <= PlainClock::kMaxUs &&
         event.time_us >= -PlainClock::kMaxUs;
}

// Decodes records of EventFormat::kPlain; for its sinks see event_decoder.h. Counts what cannot be
// read and damaged times as unknown words, and new clock epochs as time_steps_back.
class PlainEventDecoder : public WordDecoder<PlainEventDecoder, PlainEvent> {
  using Base = WordDecoder<PlainEventDecoder, PlainEvent>;

 public:
  using Base::Base;

  int64_t time_us() const { return clock_.time_us(); }

 private:
  friend Base;

  std::optional<int64_t> TimeOf(const PlainEvent& event) const {
    return IsReadable(event) ? std::optional(event.time_us) : std::nullopt;
  }

  template <typename Sink>
  void Take(const PlainEvent& event, const uint8_t* rest, const uint8_t* end, Sink& sink) {
    if (!IsReadable(event)) [[unlikely]] {
      ++faults_.unknown_words;
      return;
    }
    if (!clock_.Take(event.time_us)) [[unlikely]] {
      const std::optional<int64_t> next = FindTime(rest, end);
      switch (clock_.Decide(event.time_us, next ? &*next : nullptr)) {
        case PlainClock::Verdict::kDamaged:
          ++faults_.unknown_words;
          return;
        case PlainClock::Verdict::kStepBack:
        case PlainClock::Verdict::kLeap:
          ++faults_.time_steps_back;
          sink.TimeStepBack(event.time_us);
          break;
        case PlainClock::Verdict::kGoesOn:
          break;
      }
    }
    if (event.kind >= PlainEvent::kTriggerFalling) {
      sink.Trigger(TriggerEvent{.time_us = event.time_us,
                                .channel = event.channel,
                                .rising = event.kind == PlainEvent::kTriggerRising});
    } else if (event.x < geometry_.width && event.y < geometry_.height) {
      sink.Event(event.x, event.y, event.kind == PlainEvent::kOn,
                 static_cast<uint32_t>(event.time_us));
    } else {
      ++faults_.outside_geometry;
    }
  }

  PlainClock clock_;
};

}  // namespace rigcal::agent
