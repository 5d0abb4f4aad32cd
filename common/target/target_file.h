// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/target/target.h"

namespace rigcal {

// Of a point whose line gives none: drilled or printed with care.
inline constexpr double kDefaultPointSigmaM = 0.0005;

// The points of a rigid target. One line for each: its label, x, y and z in metres, and, if given,
// one sigma of each coordinate in metres (0 = exact), separated by commas or white space. Blank
// lines and what follows a # are skipped. Points are markers in the order of their lines.
//
// NOT_FOUND, PERMISSION_DENIED, FAILED_PRECONDITION (no regular file); INVALID_ARGUMENT: names file
// and line, says what is wrong there and shows a right line. A target of more than 200 points is
// refused at the line of the 201st.
absl::StatusOr<std::vector<TargetPoint>> ReadTargetFile(const std::string& path);

// One line of it; `text` holds a point. INVALID_ARGUMENT: what is wrong with it.
absl::StatusOr<TargetPoint> ParseTargetPoint(std::string_view text);

// What is wrong with a point by itself (label, range, sigma); empty: nothing.
std::string TargetPointFault(const TargetPoint& point);

}  // namespace rigcal
