// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "agent/event/event.h"
#include "agent/event/event_decoder.h"

namespace rigcal::agent {

// The text in front of a RAW file: lines that begin with '%', the last of them "% end" in newer
// files. Old files have no such line; their events follow the last line.
struct RawHeader {
  EventFormat format = EventFormat::kEvt3;
  bool halves_swapped = false;                // EVT 2.1 as an IMX636 sends it
  std::optional<SensorGeometry> geometry;     // none: not stated
  size_t byte_count = 0;                      // the events begin here
  std::map<std::string, std::string> fields;  // as written, "date" -> "2023-01-01 00:00:00"
};

// Reads the header at the front of a file's bytes (the first 64 KiB are enough). From "% evt 3.0"
// or
// "% format EVT3;height=480;width=640" the format, from the latter or "% geometry 640x480" the
// geometry; where both are there they must agree. Sensors of the third generation did not write
// their geometry: it is taken from the name of their plugin.
//
// INVALID_ARGUMENT, each with a byte offset: not a RAW file, no format, an unknown format (the
// known ones are listed), a geometry that is invalid or contradicts itself.
absl::StatusOr<RawHeader> ParseRawHeader(std::span<const uint8_t> bytes);

}  // namespace rigcal::agent
