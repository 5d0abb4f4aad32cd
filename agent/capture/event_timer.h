// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <variant>

#include "agent/event/event.h"
#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"

namespace rigcal::agent {

// Follows the time of an encoded stream exactly as its decoder does.
class EventTimer {
 public:
  EventTimer(EventFormat format, bool halves_swapped, const SensorGeometry& geometry);

  // The next whole words.
  void Take(std::span<const uint8_t> bytes);
  // Of the sensor's clock behind the last word, overflows taken out.
  int64_t time_us() const;

 private:
  using Decoder = std::variant<Evt2Decoder, Evt21Decoder, Evt3Decoder, PlainEventDecoder>;
  Decoder decoder_;
};

}  // namespace rigcal::agent
