// SPDX-License-Identifier: Apache-2.0
#include "common/board/board.h"

#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"
#include "common/text/shortest_text.h"

namespace rigcal {
namespace {

constexpr int kMinPointsOfSide = 3;
constexpr int kMaxPointsOfSide = 60;
constexpr double kMostMarkerShare = 0.95;  // of a square
constexpr int kMaxCount = 1000000;         // what can be doubled; Validate refuses it
constexpr double kMinSpacingM = 0.0005;
constexpr double kMaxSpacingM = 1;
constexpr double kMinThicknessM = 0.0005;
constexpr double kMaxThicknessM = 0.1;
constexpr std::string_view kTwoSided = "two-sided=";

constexpr std::array<std::pair<std::string_view, BoardKind>, 5> kBoardKinds = {{
    {"checker", BoardKind::kChecker},
    {"circles", BoardKind::kCircles},
    {"circles-symmetric", BoardKind::kCirclesSymmetric},
    {"charuco", BoardKind::kCharuco},
    {"aprilgrid", BoardKind::kAprilGrid},
}};

constexpr char kBoardExamples[] =
    "; a board is board:checker,9x6,0.03 (9 x 6 inner corners, not squares; squares of 0.03 m), "
    "board:circles,4x11,0.02 (asymmetric), board:circles-symmetric,9x6,0.02, "
    "board:charuco,8x6,0.03,0.022,5x5_100 (8 x 6 squares) or board:aprilgrid,6x6,0.088,0.3; the "
    "last two with ,two-sided=0.004 behind it where both sides are printed, 0.004 m apart";

// OpenCV's predefined dictionaries, and how many markers each has.
struct Dictionary {
  const char* name;
  int markers;
};
constexpr Dictionary kDictionaries[] = {
    {"4x4_50", 50},         {"4x4_100", 100},      {"4x4_250", 250},      {"4x4_1000", 1000},
    {"5x5_50", 50},         {"5x5_100", 100},      {"5x5_250", 250},      {"5x5_1000", 1000},
    {"6x6_50", 50},         {"6x6_100", 100},      {"6x6_250", 250},      {"6x6_1000", 1000},
    {"7x7_50", 50},         {"7x7_100", 100},      {"7x7_250", 250},      {"7x7_1000", 1000},
    {"original", 1024},     {"apriltag_16h5", 30}, {"apriltag_25h9", 35}, {"apriltag_36h10", 2320},
    {"apriltag_36h11", 587}};

// How many markers a dictionary has; 0: there is none of that name.
int MarkersOf(std::string_view name) {
  for (const Dictionary& dictionary : kDictionaries) {
    if (name == dictionary.name) return dictionary.markers;
  }
  return 0;
}

// Counts as people give them: of a ChArUco board squares, of an April grid tags.
int PointsOf(BoardKind kind, int count) {
  if (kind == BoardKind::kCharuco) return count - 1;
  return kind == BoardKind::kAprilGrid ? 2 * count : count;
}
int CountOf(BoardKind kind, int points) {
  if (kind == BoardKind::kCharuco) return points + 1;
  return kind == BoardKind::kAprilGrid ? points / 2 : points;
}

std::string_view NameOfKind(BoardKind kind) {
  for (const auto& [name, of_name] : kBoardKinds) {
    if (kind == of_name) return name;
  }
  return "?";
}

std::string_view ExampleOf(BoardKind kind) {
  switch (kind) {
    case BoardKind::kChecker:
      return "board:checker,9x6,0.03 (9 x 6 inner corners, not squares; squares of 0.03 m)";
    case BoardKind::kCircles:
      return "board:circles,4x11,0.02 (4 circles in each of 11 rows, 0.02 m from row to row)";
    case BoardKind::kCirclesSymmetric:
      return "board:circles-symmetric,9x6,0.02 (9 x 6 circles, 0.02 m from centre to centre)";
    case BoardKind::kCharuco:
      return "board:charuco,8x6,0.03,0.022,5x5_100 (8 x 6 squares of 0.03 m, markers of 0.022 m)";
    case BoardKind::kAprilGrid:
      return "board:aprilgrid,6x6,0.088,0.3 (6 x 6 tags of 0.088 m, gaps of 0.3 of that)";
  }
  return "";
}

// With an example of its kind, or of every kind where that is not known.
absl::Status BoardFault(std::string_view text, const std::string& what,
                        std::optional<BoardKind> kind = std::nullopt) {
  const std::string head = absl::StrCat("\"", std::string(text), "\": ", what);
  if (!kind) return absl::InvalidArgumentError(absl::StrCat(head, kBoardExamples));
  return absl::InvalidArgumentError(
      absl::StrCat(head, "; an example is ", std::string(ExampleOf(*kind))));
}

}  // namespace

bool Board::HasTwin() const {
  switch (kind) {
    case BoardKind::kChecker:
      return (columns + rows) % 2 == 0;
    case BoardKind::kCircles:
      // With an odd number of rows the last row is as the first one.
      return rows % 2 == 0;
    case BoardKind::kCirclesSymmetric:
      return true;
    case BoardKind::kCharuco:
    case BoardKind::kAprilGrid:
      return false;
  }
  return true;
}

int Board::side_marker_count() const {
  if (kind == BoardKind::kCharuco) return (columns + 1) * (rows + 1) / 2;
  return kind == BoardKind::kAprilGrid ? columns * rows / 4 : 0;
}

Board Board::OneSide() const {
  Board front = *this;
  front.thickness_m = 0;
  return front;
}

RigidTransform Board::FrontFromBack() const {
  const double width_m = OneSide().Points()[static_cast<size_t>(columns - 1)].x();
  const double depth_m = kind == BoardKind::kAprilGrid ? -thickness_m : thickness_m;
  return {Eigen::Quaterniond(0, 0, 1, 0), Eigen::Vector3d(width_m, 0, depth_m)};
}

BoardSide Board::SideSeenFrom(const Eigen::Vector3d& x_in_board_m) const {
  if (!IsTwoSided()) return BoardSide::kFront;
  const double depth_m = kind == BoardKind::kAprilGrid ? -x_in_board_m.z() : x_in_board_m.z();
  return depth_m > 0.5 * thickness_m ? BoardSide::kBack : BoardSide::kFront;
}

std::vector<Eigen::Vector3d> Board::Points() const {
  std::vector<Eigen::Vector3d> points;
  points.reserve(static_cast<size_t>(point_count()));
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      if (kind == BoardKind::kAprilGrid) {
        const double pitch_m = (1 + gap_share) * spacing_m;
        points.emplace_back(column / 2 * pitch_m + column % 2 * spacing_m,
                            row / 2 * pitch_m + row % 2 * spacing_m, 0);
        continue;
      }
      const int along = kind == BoardKind::kCircles ? 2 * column + row % 2 : column;
      points.emplace_back(along * spacing_m, row * spacing_m, 0);
    }
  }
  if (!IsTwoSided()) return points;
  const RigidTransform front_from_back = FrontFromBack();
  const size_t count = points.size();
  for (size_t i = 0; i < count; ++i) {
    // Half a turn by quaternion leaves dust in the last digit.
    const Eigen::Vector3d& shift_m = front_from_back.translation_m;
    points.emplace_back(shift_m.x() - points[i].x(), points[i].y(), shift_m.z());
  }
  return points;
}

double Board::CircleDiameter() const {
  if (!HasCircles()) return 0;
  if (circle_diameter_m > 0) return circle_diameter_m;
  return kCircleShare * spacing_m * (kind == BoardKind::kCircles ? std::numbers::sqrt2 : 1);
}

absl::Status Board::Validate() const {
  FaultList faults;
  const bool may_be_narrow = kind == BoardKind::kCircles || HasMarkers();
  const int least_columns = may_be_narrow ? kMinPointsOfSide - 1 : kMinPointsOfSide;
  const int least_rows = HasMarkers() ? kMinPointsOfSide - 1 : kMinPointsOfSide;
  faults.CheckRange("the number of columns", columns, least_columns, kMaxPointsOfSide);
  faults.CheckRange("the number of rows", rows, least_rows, kMaxPointsOfSide);
  if (spacing_m > kMaxSpacingM && spacing_m <= 1000 * kMaxSpacingM) {
    faults.Add("the spacing is ", spacing_m, " m? It is given in metres: ", spacing_m, " mm are ",
               ShortestText(spacing_m / 1000));
  } else {
    faults.CheckRange("the spacing", spacing_m, kMinSpacingM, kMaxSpacingM, " m");
  }
  if (kind == BoardKind::kCharuco) {
    const int markers = (IsTwoSided() ? 2 : 1) * side_marker_count();
    const int most = MarkersOf(dictionary);
    if (most > 0 && markers > most) {
      faults.Add("the board has ", markers, " markers", IsTwoSided() ? " on both sides" : "",
                 ", and the dictionary ", dictionary, " has ", most);
    }
    if (!(marker_m > 0 && marker_m <= kMostMarkerShare * spacing_m)) {
      faults.Add("markers of ", marker_m, " m do not fit into squares of ", spacing_m,
                 " m with a white rim");
    }
    if (most == 0) {
      faults.Add("there is no dictionary \"", dictionary, "\": it is one of ",
                 absl::StrJoin(kDictionaries, " ", [](std::string* out, const Dictionary& known) {
                   out->append(known.name);
                 }));
    }
  } else if (marker_m != 0 || !dictionary.empty()) {
    faults.Add("only a ChArUco board has a marker's side and a dictionary");
  }
  if (kind == BoardKind::kAprilGrid) {
    faults.CheckRange("the gap over a tag's side", gap_share, 0.05, 1);
    const int tags = (IsTwoSided() ? 2 : 1) * side_marker_count();
    if (tags > MarkersOf("apriltag_36h11")) {
      faults.Add("the grid has ", tags, " tags, and there are ", MarkersOf("apriltag_36h11"));
    }
    if (columns % 2 != 0 || rows % 2 != 0) faults.Add("each tag has two corners along each side");
  } else if (gap_share != 0) {
    faults.Add("only an April grid has gaps");
  }
  const double nearest_m = spacing_m * (kind == BoardKind::kCircles ? std::numbers::sqrt2 : 1);
  if (!HasCircles() && circle_diameter_m != 0) {
    faults.Add("only boards of circles have a diameter");
  } else if (circle_diameter_m != 0 && !(circle_diameter_m > 0 && circle_diameter_m < nearest_m)) {
    faults.Add("the diameter of the circles is ", circle_diameter_m, " m, but they are ", nearest_m,
               " m apart");
  }
  if (thickness_m != 0 && !HasMarkers()) {
    faults.Add(
        "without markers the two sides of a board cannot be told apart: take a ChArUco board or an "
        "April grid (board:charuco,10x7,0.025,0.018,5x5_100,two-sided=0.004), whose back has other "
        "markers than its front");
  } else if (thickness_m > kMaxThicknessM && thickness_m <= 1000 * kMaxThicknessM) {
    faults.Add("the two sides are ", thickness_m, " m apart? It is given in metres: ", thickness_m,
               " mm are ", ShortestText(thickness_m / 1000));
  } else if (thickness_m != 0) {
    faults.CheckRange("the distance of the two sides", thickness_m, kMinThicknessM, kMaxThicknessM,
                      " m");
  }
  return faults.Result();
}

namespace {

// What follows the kind, part by part.
std::string_view PartsOf(BoardKind kind) {
  switch (kind) {
    case BoardKind::kCharuco:
      return "counts of squares, side of a square, side of a marker, dictionary";
    case BoardKind::kAprilGrid:
      return "counts of tags, side of a tag, gap between tags over that side";
    case BoardKind::kCircles:
    case BoardKind::kCirclesSymmetric:
      return "counts, spacing in metres, and the diameter of the circles if they are not as "
             "printed";
    case BoardKind::kChecker:
      break;
  }
  return "counts, spacing in metres";
}

bool HasParts(BoardKind kind, size_t count) {
  if (kind == BoardKind::kCharuco) return count == 5;
  if (kind == BoardKind::kAprilGrid) return count == 4;
  return count == 3 || (kind != BoardKind::kChecker && count == 4);
}

}  // namespace

absl::StatusOr<Board> ParseBoard(std::string_view text) {
  constexpr std::string_view kPrefix = "board:";
  if (text.substr(0, kPrefix.size()) != kPrefix) {
    return BoardFault(text, "a board begins with board:");
  }
  std::vector<std::string> parts = absl::StrSplit(std::string(text.substr(kPrefix.size())), ',');
  Board board;
  if (parts.back().starts_with(kTwoSided)) {
    const std::string value = parts.back().substr(kTwoSided.size());
    if (!absl::SimpleAtod(value, &board.thickness_m) || !std::isfinite(board.thickness_m)) {
      return BoardFault(text, absl::StrCat("\"", value, "\" is no number of metres"));
    }
    if (board.thickness_m == 0) {
      return BoardFault(text,
                        "the two sides are 0 m apart; leave two-sided= out where one is printed");
    }
    parts.pop_back();
  }
  bool is_known = false;
  for (const auto& [name, kind] : kBoardKinds) {
    if (parts[0] != name) continue;
    board.kind = kind;
    is_known = true;
  }
  if (!is_known) return BoardFault(text, absl::StrCat("there is no kind \"", parts[0], "\""));
  if (!HasParts(board.kind, parts.size())) {
    return BoardFault(
        text,
        absl::StrCat("there are ", parts.size(), " parts with commas between them; they are kind, ",
                     std::string(PartsOf(board.kind))),
        board.kind);
  }
  const std::vector<std::string> counts = absl::StrSplit(parts[1], 'x');
  if (counts.size() != 2 || !absl::SimpleAtoi(counts[0], &board.columns) ||
      !absl::SimpleAtoi(counts[1], &board.rows)) {
    return BoardFault(text, absl::StrCat("\"", parts[1], "\" is not COLUMNSxROWS"), board.kind);
  }
  for (int* count : {&board.columns, &board.rows}) {
    if (std::abs(*count) > kMaxCount) {
      return BoardFault(text, absl::StrCat("\"", parts[1], "\": nobody counts so many"),
                        board.kind);
    }
    *count = PointsOf(board.kind, *count);
  }
  if (!absl::SimpleAtod(parts[2], &board.spacing_m) || !std::isfinite(board.spacing_m)) {
    return BoardFault(text, absl::StrCat("\"", parts[2], "\" is no number of metres"), board.kind);
  }
  double* const fourth = board.kind == BoardKind::kCharuco     ? &board.marker_m
                         : board.kind == BoardKind::kAprilGrid ? &board.gap_share
                                                               : &board.circle_diameter_m;
  if (parts.size() > 3 && !(absl::SimpleAtod(parts[3], fourth) && std::isfinite(*fourth))) {
    return BoardFault(text, absl::StrCat("\"", parts[3], "\" is no number"), board.kind);
  }
  // OpenCV's own spelling is DICT_5X5_100.
  if (parts.size() > 4) {
    board.dictionary = std::string(absl::StripPrefix(absl::AsciiStrToLower(parts[4]), "dict_"));
  }
  const absl::Status valid = board.Validate();
  if (!valid.ok()) return BoardFault(text, std::string(valid.message()), board.kind);
  return board;
}

std::string FormatBoard(const Board& board) {
  std::string text = absl::StrCat(
      "board:", std::string(NameOfKind(board.kind)), ",", CountOf(board.kind, board.columns), "x",
      CountOf(board.kind, board.rows), ",", ShortestText(board.spacing_m));
  for (const double value : {board.marker_m, board.gap_share, board.circle_diameter_m}) {
    if (value > 0) absl::StrAppend(&text, ",", ShortestText(value));
  }
  if (!board.dictionary.empty()) absl::StrAppend(&text, ",", board.dictionary);
  if (board.IsTwoSided()) {
    absl::StrAppend(&text, ",", std::string(kTwoSided), ShortestText(board.thickness_m));
  }
  return text;
}

}  // namespace rigcal
