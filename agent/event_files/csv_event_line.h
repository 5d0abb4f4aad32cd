// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "absl/container/inlined_vector.h"
#include "agent/event_files/plain_event_reader.h"

namespace rigcal::agent {

// Which field of a line is what, from 0.
struct CsvEventColumns {
  size_t x = 0, y = 1, p = 2, t = 3;
  size_t count = 4;
  TimeUnit time_unit = TimeUnit::kAuto;  // of the header line
};

// The fields of a line, separated by comma, semicolon, tab or blanks, without blanks around them.
using CsvFields = absl::InlinedVector<std::string_view, 8>;
CsvFields SplitCsvEventFields(std::string_view line);

// Whether a line is names and no numbers.
bool IsCsvEventHeader(std::string_view line);
// From a header line: x; y; p, pol or polarity; t, ts, time or timestamp, the last ones also with
// _us, _ms, _s or _ns; in any order, among others. INVALID_ARGUMENT names what is missing.
absl::StatusOr<CsvEventColumns> ParseCsvEventHeader(std::string_view line);
// From an order such as "txyp". INVALID_ARGUMENT.
absl::StatusOr<CsvEventColumns> ParseCsvEventOrder(std::string_view order);

// Whether its time has a fraction that is not zero.
bool HasTimeFraction(std::string_view line, const CsvEventColumns& columns);

// Reads a line; times are rounded to whole microseconds. What is wrong with it, or none. A column
// or row that no sensor has is no fault of the line: it becomes 65535.
std::optional<std::string> ParseCsvEventLine(std::string_view line, const CsvEventColumns& columns,
                                             TimeUnit unit, PlainEvent* event);

}  // namespace rigcal::agent
