// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "agent/detect/event/blink_filter.h"
#include "agent/detect/event/blink_wand_timeline.h"
#include "agent/event/event.h"

namespace rigcal::agent {

// Feeds the filter with a decoder's batches of events, stopped whenever something is due. In a
// header, so that it is compiled into the decoders' loops.
struct StoppingConsumer {
  BlinkFilter::Pass pass;
  BlinkWandTimeline* timeline;
  uint32_t stop_us;

  bool IsDue(const PackedEvent& event) const {
    return static_cast<int32_t>(event.time_us - stop_us) >= 0;
  }
  bool IsAnyDue(std::span<const PackedEvent> events) const {
    bool any = false;
    for (const PackedEvent& event : events) any |= IsDue(event);
    return any;
  }
  void Events(std::span<const PackedEvent> events) {
    while (IsAnyDue(events)) {
      size_t next = 0;
      while (!IsDue(events[next])) ++next;
      Feed(events.first(next));
      stop_us = timeline->Reach(events[next].time_us);
      Feed(events.subspan(next, 1));
      events = events.subspan(next + 1);
    }
    Feed(events);
  }
  void Feed(std::span<const PackedEvent> events) {
    if (events.empty()) return;
    timeline->NoteEvents();
    pass.Events(events);
  }
  void Trigger(const TriggerEvent& trigger) { stop_us = timeline->TakeTrigger(trigger); }
  void TimeStepBack(int64_t time_us) { stop_us = timeline->StepBack(time_us); }
};

}  // namespace rigcal::agent
