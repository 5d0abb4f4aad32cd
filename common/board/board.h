// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal {

enum class BoardKind : uint8_t {
  kChecker = 1,           // points: inner corners
  kCircles = 2,           // points: centres; every second row is shifted by half a pitch
  kCirclesSymmetric = 3,  // points: centres
};

// A flat board with a regular pattern. Frame `board`: origin at point 0, x along a row of points, y
// from row to row, z away from who looks at the pattern, metres. Point (column c, row r) has index
// r * columns + c and lies, as with OpenCV, at
//   checker, circles-symmetric:  (c s, r s, 0)
//   circles:                     ((2 c + r mod 2) s, r s, 0)
// with s = spacing_m. Seen from the front and upright, point 0 is at the top left.
struct Board {
  BoardKind kind = BoardKind::kChecker;
  int columns = 0;  // points in a row; of a checker one less than squares
  int rows = 0;
  double spacing_m = 0;  // side of a square; distance of circles; of `circles`, distance of rows

  int point_count() const { return columns * rows; }
  // It looks the same when it is turned by 180 degrees: a checker whose counts are both even or
  // both odd, and every symmetric grid of circles. That is no fault for the calibration of a lens.
  bool HasTwin() const;
  // In frame `board`, by index.
  std::vector<Eigen::Vector3d> Points() const;
  friend bool operator==(const Board&, const Board&) = default;

  // Every fault: counts that are not 3 to 60 (`circles`: from 2 columns on), a spacing that is not
  // 0.5 mm to 1 m.
  absl::Status Validate() const;
};

// Reads `board:checker,9x6,0.03`, `board:circles,4x11,0.02` or `board:circles-symmetric,9x6,0.02`:
// kind, columns x rows of points, spacing in metres. INVALID_ARGUMENT quotes the offending part and
// shows a right example; a spacing that looks like millimetres is named.
absl::StatusOr<Board> ParseBoard(std::string_view text);
// The same notation; ParseBoard(FormatBoard(b)) == b.
std::string FormatBoard(const Board& board);

}  // namespace rigcal
