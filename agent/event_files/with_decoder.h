// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"
#include "agent/event_files/event_file.h"

namespace rigcal::agent {

// Calls `take` with a decoder of the file's format.
template <typename Take>
absl::Status WithDecoder(const EventFileHeader& header, SensorGeometry geometry, Take take) {
  switch (header.format) {
    case EventFormat::kEvt2:
      return take(Evt2Decoder(geometry));
    case EventFormat::kEvt21:
      return take(Evt21Decoder(geometry, header.halves_swapped));
    case EventFormat::kEvt3:
      return take(Evt3Decoder(geometry));
    case EventFormat::kPlain:
      break;
  }
  return take(PlainEventDecoder(geometry));
}

}  // namespace rigcal::agent
