// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal {

enum class BoardKind : uint8_t {
  kChecker = 1,           // points: inner corners
  kCircles = 2,           // points: centres; every second row is shifted by half a pitch
  kCirclesSymmetric = 3,  // points: centres
  kCharuco = 4,           // a checker with markers in its white squares; points: inner corners
  kAprilGrid = 5,         // kalibr's grid of tags; points: the corners of the tags
};

// A flat board with a regular pattern. Frame `board`: origin at point 0, x along a row of points, y
// from row to row, z away from who looks at the pattern, metres. Point (column c, row r) has index
// r * columns + c and lies, as with OpenCV, at
//   checker, circles-symmetric:  (c s, r s, 0)
//   charuco:                     likewise; (0, 0, 0) is the inner corner at the top left
//   circles:                     ((2 c + r mod 2) s, r s, 0)
// with s = spacing_m; and of an April grid of tags of side t = spacing_m and gaps of g = share t,
// as with kalibr, whose y points up and whose z points to who looks at it:
//   aprilgrid:                   (c / 2 (t + g) + c mod 2 t, r / 2 (t + g) + r mod 2 t, 0)
// Seen from the front and upright, point 0 is at the top left; of an April grid at the lower left.
//
// A board with markers may be printed on both sides, so that cameras which face each other see one
// body. Its back is the same print with the next markers of the dictionary, turned about the
// vertical axis through the middle of the pattern, as one turns a page: upright from behind, too,
// and its point (column c, row r) is behind the front's point (columns - 1 - c, r), at z =
// thickness_m, of an April grid at z = -thickness_m. Points of the back follow those of the front.
enum class BoardSide : uint8_t { kFront = 1, kBack = 2 };

struct Board {
  BoardKind kind = BoardKind::kChecker;
  int columns = 0;  // points in a row; of a checker one less than squares
  int rows = 0;
  // Side of a square or a tag; distance of circles; of `circles`, distance of rows.
  double spacing_m = 0;
  double circle_diameter_m = 0;  // of boards of circles; 0: kCircleShare of the nearest distance

  double marker_m = 0;     // of a ChArUco board: side of a marker
  std::string dictionary;  // likewise: "4x4_50" to "7x7_1000", or "apriltag_36h11"
  double gap_share = 0;    // of an April grid: gap between tags over their side
  // Of a board with markers on both sides: from the print of the front to that of the back, with
  // everything between them. 0: it has one side.
  double thickness_m = 0;

  // Its points are found one by one, beside markers: some may be missing.
  bool HasMarkers() const { return kind == BoardKind::kCharuco || kind == BoardKind::kAprilGrid; }
  bool HasCircles() const {
    return kind == BoardKind::kCircles || kind == BoardKind::kCirclesSymmetric;
  }
  // Of a board's circles as `rigcal board print` draws them, over the distance of the nearest two.
  static constexpr double kCircleShare = 0.55;
  // 0 of a board without circles.
  double CircleDiameter() const;

  bool IsTwoSided() const { return thickness_m > 0; }
  int side_point_count() const { return columns * rows; }
  int point_count() const { return (IsTwoSided() ? 2 : 1) * side_point_count(); }
  // Markers of each side, numbered from 0, those of the back from this number on. 0: it has none.
  int side_marker_count() const;
  // Its front alone.
  Board OneSide() const;
  // The frame that the points of the back would have as a front of their own: half a turn about y.
  RigidTransform FrontFromBack() const;
  // The side that is seen from a place in frame `board`.
  BoardSide SideSeenFrom(const Eigen::Vector3d& x_in_board_m) const;
  BoardSide SideOf(size_t point) const {
    return point < static_cast<size_t>(side_point_count()) ? BoardSide::kFront : BoardSide::kBack;
  }
  // It looks the same when it is turned by 180 degrees: a checker whose counts are both even or
  // both odd, and every symmetric grid of circles. That is no fault for the calibration of a lens.
  bool HasTwin() const;
  // In frame `board`, by index.
  std::vector<Eigen::Vector3d> Points() const;
  friend bool operator==(const Board&, const Board&) = default;

  // Every fault: counts that are not 3 to 60 (`circles`: from 2 columns on), a spacing that is not
  // 0.5 mm to 1 m; two sides without markers, or not 0.5 to 100 mm apart.
  absl::Status Validate() const;
};

// Reads, metres throughout:
//   board:checker,9x6,0.03                 inner corners, side of a square
//   board:circles,4x11,0.02                circles in a row x rows, from row to row; asymmetric
//   board:circles-symmetric,9x6,0.02       circles, from centre to centre
//   board:charuco,8x6,0.03,0.022,5x5_100   squares, their side, side of a marker, dictionary
//   board:aprilgrid,6x6,0.088,0.3          tags, their side, gap over side (kalibr)
// The last two may be followed by ,two-sided=0.004: the distance of the two prints. Circles may be
// followed by their diameter, if it is not that of printed ones. INVALID_ARGUMENT quotes the
// offending part and shows a right example; a spacing that looks like millimetres is named.
absl::StatusOr<Board> ParseBoard(std::string_view text);
// The same notation; ParseBoard(FormatBoard(b)) == b.
std::string FormatBoard(const Board& board);

}  // namespace rigcal
