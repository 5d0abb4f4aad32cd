// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <variant>

#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"

namespace rigcal::agent {

// The decoder of whichever format a stream has.
using AnyEventDecoder = std::variant<Evt2Decoder, Evt21Decoder, Evt3Decoder, PlainEventDecoder>;

// `halves_swapped`: of EVT 2.1, as in Evt2xDecoder.
inline AnyEventDecoder MakeEventDecoder(EventFormat format, bool halves_swapped,
                                        SensorGeometry geometry) {
  if (format == EventFormat::kEvt2) return Evt2Decoder(geometry);
  if (format == EventFormat::kEvt21) return Evt21Decoder(geometry, halves_swapped);
  if (format == EventFormat::kEvt3) return Evt3Decoder(geometry);
  return PlainEventDecoder(geometry);
}

}  // namespace rigcal::agent
