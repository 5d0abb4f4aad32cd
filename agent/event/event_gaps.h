// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "agent/event/event.h"

namespace rigcal::agent {

// Silence of the whole sensor while the scene otherwise fires: packets that were lost on the way. A
// gap is a silence much longer than what is usual within a blink period of this stream; a still
// scene is silent for long, and has none. Times are the lower 32 bits of the sensor's clock. Looks
// at single events only where a batch takes long: little of a busy stream. One thread at a time.
class EventGaps {
 public:
  // A shorter silence is no gap, whatever is usual.
  static constexpr int32_t kLeastUs = 300;

  struct Gap {
    uint32_t from_us = 0, until_us = 0;  // the events before and behind it
  };

  // Silence for longer than `longest_us` is no gap: the scene is dark, or the clock jumps.
  EventGaps(double period_us, int64_t longest_us);

  // Before Next is called for these events: else nothing has to be looked for.
  bool MayHold(std::span<const PackedEvent> events) const {
    return static_cast<int32_t>(events.back().time_us - last_us_) >= kLeastUs || !has_begun_;
  }
  // The events that were looked at are over. To be called for those that MayHold none.
  void Pass(std::span<const PackedEvent> events) { last_us_ = events.back().time_us; }
  // How many of the next events come before a gap; all: there is none. Those are over then, and
  // last() is the gap.
  size_t Next(std::span<const PackedEvent> events);
  void Restart();
  // The stream has ended: what follows is no silence.
  void End() { has_begun_ = false; }

  const Gap& last() const { return gaps_.back(); }
  // A part of these times is in a gap; one that has not ended by `until_us` counts, too.
  bool Overlap(uint32_t from_us, uint32_t until_us) const;
  // By now the silence is so long that it is a gap, which began then.
  bool IsOpenAt(uint32_t time_us) const {
    return has_begun_ && static_cast<int32_t>(time_us - last_us_) >= threshold_us_;
  }
  uint32_t silent_since_us() const { return last_us_; }

  uint64_t count() const { return count_; }
  uint64_t total_us() const { return total_us_; }

 private:
  // Ends the windows that are over at the last event.
  void Learn();

  const uint32_t window_us_;
  const int64_t longest_us_;
  bool has_begun_ = false;
  uint32_t last_us_ = 0;
  uint32_t window_from_us_ = 0;
  int32_t longest_in_window_us_ = 0;
  std::vector<int32_t> usual_us_;  // longest silences of the last windows, in turns
  size_t next_usual_ = 0;
  std::vector<int32_t> sorted_us_;
  int32_t threshold_us_;
  std::vector<Gap> gaps_;  // the last ones
  uint64_t count_ = 0, total_us_ = 0;
};

}  // namespace rigcal::agent
