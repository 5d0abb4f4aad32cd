// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/target/target.h"

namespace rigcal {

// Of a point whose line gives none: drilled or printed with care.
inline constexpr double kDefaultPointSigmaM = 0.0005;

// What a line says.
enum class PointLines : uint8_t {
  kWithPosition,  // of a rigid target
  kMayBeLabels,   // of static points, whose positions need not be known
};
struct GivenPoint {
  TargetPoint point;
  bool has_position = true;
};

// The labelled points of a target. One line for each: its label, x, y and z in metres, and, if
// given, one sigma of each coordinate in metres (0 = exact), separated by commas or white space;
// or the label alone, where that may be. Blank lines and what follows a # are skipped. Points are
// markers in the order of their lines.
//
// NOT_FOUND, PERMISSION_DENIED, FAILED_PRECONDITION (no regular file); INVALID_ARGUMENT: names file
// and line, says what is wrong there and shows a right line. A target of more than 200 points is
// refused at the line of the 201st.
absl::StatusOr<std::vector<GivenPoint>> ReadTargetFile(const std::string& path, PointLines lines);

// One line of it; `text` holds a point. INVALID_ARGUMENT: what is wrong with it.
absl::StatusOr<GivenPoint> ParseTargetPoint(std::string_view text, PointLines lines);

// What is wrong with a point by itself (label, range, sigma); empty: nothing.
std::string TargetPointFault(const TargetPoint& point);

}  // namespace rigcal
