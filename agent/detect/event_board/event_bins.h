// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "agent/event/event.h"

namespace rigcal::agent {

// The events of a millisecond.
struct EventBin {
  int64_t time_ms = 0;
  std::vector<PackedEvent> events;
  int net = 0;  // brighter less darker
};

// The last milliseconds of a stream, without gaps.
class EventBins {
 public:
  static constexpr size_t kKept = 220;

  // Events that come late by less than what is kept go where they belong.
  void Add(int64_t time_us, const PackedEvent& event) {
    const int64_t time_ms = time_us >= 0 ? time_us / 1000 : (time_us - 999) / 1000;
    if (bins_.empty()) Append(time_ms);
    if (time_ms > bins_.back().time_ms) Extend(time_ms);
    const int64_t back = bins_.back().time_ms - time_ms;
    const size_t from_end =
        back < static_cast<int64_t>(bins_.size()) ? static_cast<size_t>(back) : bins_.size() - 1;
    EventBin& bin = bins_[bins_.size() - 1 - from_end];
    bin.events.push_back(event);
    bin.net += event.on() ? 1 : -1;
  }
  bool empty() const { return bins_.empty(); }
  int64_t last_ms() const { return bins_.back().time_ms; }
  const EventBin* At(int64_t time_ms) const {
    if (bins_.empty() || time_ms < bins_.front().time_ms || time_ms > last_ms()) return nullptr;
    return &bins_[static_cast<size_t>(time_ms - bins_.front().time_ms)];
  }
  void Clear() { bins_.clear(); }

 private:
  void Append(int64_t time_ms) {
    bins_.emplace_back();
    bins_.back().time_ms = time_ms;
  }
  void Extend(int64_t time_ms) {
    if (time_ms - bins_.back().time_ms > static_cast<int64_t>(2 * kKept)) {
      bins_.clear();
      Append(time_ms);
    }
    while (bins_.back().time_ms < time_ms) {
      Append(bins_.back().time_ms + 1);
      if (bins_.size() > kKept) bins_.pop_front();
    }
  }

  std::deque<EventBin> bins_;
};

}  // namespace rigcal::agent
