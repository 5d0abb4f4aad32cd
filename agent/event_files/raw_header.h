// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/event_files/event_file.h"

namespace rigcal::agent {

// Reads the header at the front of a RAW file's bytes (the first 64 KiB are enough): lines that
// begin with '%', the last of them "% end" in newer files. Old files have no such line; their
// events follow the last line. From "% evt 3.0" or "% format EVT3;height=480;width=640" the format,
// from the latter or "% geometry 640x480" the geometry; where both are there they must agree.
// Older cameras did not write their geometry: it is taken from the name of their plugin ("gen3") or
// from "% system_ID 49". Fields are as written: "date" -> "2023-01-01 00:00:00".
//
// INVALID_ARGUMENT, each with a byte offset: not a RAW file, no format, an unknown format (the
// known ones are listed), a geometry that is invalid or contradicts itself.
absl::StatusOr<EventFileHeader> ParseRawHeader(std::span<const uint8_t> bytes);

}  // namespace rigcal::agent
