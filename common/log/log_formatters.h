// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <spdlog/formatter.h>

#include <memory>

namespace rigcal {

// An entry of the log as one line, whatever texts from elsewhere (names, paths, errors of peers)
// are in it.

// "[2026-01-01 12:00:00.000] [rigcal-server] [info] text (correlation 5f0c...)", in local time.
// Texts cannot move the cursor: see Printable.
std::unique_ptr<spdlog::formatter> MakeTextFormatter();

// A JSON object (RFC 8259) of ASCII characters: time (RFC 3339, UTC, with milliseconds), level,
// program, message, and of LogFields those that are known. Bytes that are no UTF-8 become U+FFFD.
std::unique_ptr<spdlog::formatter> MakeJsonFormatter();

}  // namespace rigcal
