// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/simulation/events/event_readout.h"

namespace rigcal::testing {

// What a camera or its link takes out of a simulated stream of events.
struct EventDisturbance {
  uint32_t seed = 1;
  double kept_share = 1;  // of all events, at random
  int keep_every = 1;     // of all events in their order: every second, third...
  // A rate control: of each period of 200 us as many events are kept at random as fit the limit
  // (events/s); 0: no limit.
  double rate_limit = 0;
  // The same, but the first ones of each period.
  bool keeps_first = false;
  double lost_ms_share = 0;  // whole milliseconds without any event, at random

  bool is_none() const {
    return kept_share >= 1 && keep_every <= 1 && rate_limit <= 0 && lost_ms_share <= 0;
  }
};

// Disturbs a stream that comes in slices, in order of time; slices must end between milliseconds.
class EventDisturber {
 public:
  explicit EventDisturber(const EventDisturbance& disturbance) : disturbance_(disturbance) {}

  void Apply(std::vector<SimulatedEvent>* events);

 private:
  void LimitRate(std::vector<SimulatedEvent>* events) const;

  const EventDisturbance disturbance_;
  uint64_t count_ = 0;  // of the events so far
};

}  // namespace rigcal::testing
