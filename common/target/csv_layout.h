// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal {

// Where a table of markers has what.
struct CsvLayout {
  char separator = ';';
  int columns = 0;
  bool trailing_separator = false;  // behind the last column of each row
  int time_column = 0;
  // Nanoseconds in what the stamps count; more than 1 only where a header names the unit.
  int64_t time_unit_ns = 1;
  std::vector<std::pair<int, int>> markers;  // the columns of x and y
  bool has_header = false;                   // in the first line that is not blank

  // timestamp_ns;x0;y0;x1;y1;...
  static CsvLayout Of(int marker_count);
};

// The number of fields of a line.
int CsvFieldCount(std::string_view line, char separator = ';');

// The layout that most of the first lines of a file have: separated by semicolons, commas or tabs,
// with or without a separator at the end of each row. A header may name the stamps ("time",
// "timestamp_ns", "t_us", ...: their unit is its ending), columns to be left out (frame numbers,
// likelihoods), and the markers' columns ("x0", "y0", "left_x", ...). Without one, or where no line
// fits, the rows must be as CsvLayout::Of says. `lines`: without blank ones. INVALID_ARGUMENT: a
// header that does not name a time and pairs of x and y.
absl::StatusOr<CsvLayout> FindCsvLayout(const std::vector<std::string>& lines);
// Of the first lines of a file. Also NOT_FOUND, ...: it cannot be read; names it. UTF-16 is refused.
absl::StatusOr<CsvLayout> FindCsvLayoutOfFile(const std::string& path);

}  // namespace rigcal
