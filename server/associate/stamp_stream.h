// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "common/target/observation.h"

namespace rigcal::server {

struct StampRow {
  Observation* observation;
  int64_t time_ns() const { return observation->time_ns; }
};

struct StampSegment {
  size_t begin, end;     // of the stream's rows
  int64_t moved_ns = 0;  // added to its stamps
};

// One camera in one session.
struct StampStream {
  std::string session_id, camera;
  bool has_samples = false;
  std::vector<StampRow> rows;
  std::vector<bool> wrong;  // by row, refused
  int64_t period_ns = 0;
  size_t out_of_order = 0, put_back = 0;
  std::vector<StampSegment> segments;
};

// Rows that were not refused; they come first.
inline size_t RightRows(const StampStream& stream) {
  return static_cast<size_t>(std::ranges::count(stream.wrong, false));
}

// Wherever the stamps allow it, without overflow: what clocks say may be anything.
inline int64_t StampDifference(int64_t a, int64_t b) {
  int64_t difference = 0;
  if (!__builtin_sub_overflow(a, b, &difference)) return difference;
  return a < b ? std::numeric_limits<int64_t>::min() / 2 : std::numeric_limits<int64_t>::max() / 2;
}
inline int64_t StampSum(int64_t a, int64_t b) {
  int64_t sum = 0;
  return __builtin_add_overflow(a, b, &sum) ? a : sum;
}

inline std::string SecondsText(int64_t ns) {
  return absl::StrFormat("%.6g s", 1e-9 * static_cast<double>(ns));
}

}  // namespace rigcal::server
