// SPDX-License-Identifier: Apache-2.0
#include "common/board/board.h"

#include <array>
#include <cmath>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"
#include "common/text/shortest_text.h"

namespace rigcal {
namespace {

constexpr int kMinPointsOfSide = 3;
constexpr int kMaxPointsOfSide = 60;
constexpr double kMinSpacingM = 0.0005;
constexpr double kMaxSpacingM = 1;

constexpr std::array<std::pair<std::string_view, BoardKind>, 3> kBoardKinds = {{
    {"checker", BoardKind::kChecker},
    {"circles", BoardKind::kCircles},
    {"circles-symmetric", BoardKind::kCirclesSymmetric},
}};

constexpr char kBoardExamples[] =
    "; a board is board:checker,9x6,0.03 (9 x 6 inner corners, not squares; squares of 0.03 m), "
    "board:circles,4x11,0.02 (asymmetric) or board:circles-symmetric,9x6,0.02";

std::string_view NameOfKind(BoardKind kind) {
  for (const auto& [name, of_name] : kBoardKinds) {
    if (kind == of_name) return name;
  }
  return "?";
}

absl::Status BoardFault(std::string_view text, const std::string& what) {
  return absl::InvalidArgumentError(
      absl::StrCat("\"", std::string(text), "\": ", what, kBoardExamples));
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
  }
  return true;
}

std::vector<Eigen::Vector3d> Board::Points() const {
  std::vector<Eigen::Vector3d> points;
  points.reserve(static_cast<size_t>(point_count()));
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int along = kind == BoardKind::kCircles ? 2 * column + row % 2 : column;
      points.emplace_back(along * spacing_m, row * spacing_m, 0);
    }
  }
  return points;
}

absl::Status Board::Validate() const {
  FaultList faults;
  const int least_columns = kind == BoardKind::kCircles ? kMinPointsOfSide - 1 : kMinPointsOfSide;
  faults.CheckRange("the number of columns", columns, least_columns, kMaxPointsOfSide);
  faults.CheckRange("the number of rows", rows, kMinPointsOfSide, kMaxPointsOfSide);
  if (spacing_m > kMaxSpacingM && spacing_m <= 1000 * kMaxSpacingM) {
    faults.Add("the spacing is ", spacing_m, " m? It is given in metres: ", spacing_m, " mm are ",
               ShortestText(spacing_m / 1000));
  } else {
    faults.CheckRange("the spacing", spacing_m, kMinSpacingM, kMaxSpacingM, " m");
  }
  return faults.Result();
}

absl::StatusOr<Board> ParseBoard(std::string_view text) {
  constexpr std::string_view kPrefix = "board:";
  if (text.substr(0, kPrefix.size()) != kPrefix) {
    return BoardFault(text, "a board begins with board:");
  }
  const std::vector<std::string> parts =
      absl::StrSplit(std::string(text.substr(kPrefix.size())), ',');
  Board board;
  bool is_known = false;
  for (const auto& [name, kind] : kBoardKinds) {
    if (parts[0] != name) continue;
    board.kind = kind;
    is_known = true;
  }
  if (!is_known) return BoardFault(text, absl::StrCat("there is no kind \"", parts[0], "\""));
  if (parts.size() != 3) {
    return BoardFault(text, absl::StrCat("there are ", parts.size(),
                                         " parts with commas between them, not 3: kind, counts, "
                                         "spacing in metres"));
  }
  const std::vector<std::string> counts = absl::StrSplit(parts[1], 'x');
  if (counts.size() != 2 || !absl::SimpleAtoi(counts[0], &board.columns) ||
      !absl::SimpleAtoi(counts[1], &board.rows)) {
    return BoardFault(text, absl::StrCat("\"", parts[1], "\" is not COLUMNSxROWS"));
  }
  if (!absl::SimpleAtod(parts[2], &board.spacing_m) || !std::isfinite(board.spacing_m)) {
    return BoardFault(text, absl::StrCat("\"", parts[2], "\" is no number of metres"));
  }
  const absl::Status valid = board.Validate();
  if (!valid.ok()) return BoardFault(text, std::string(valid.message()));
  return board;
}

std::string FormatBoard(const Board& board) {
  return absl::StrCat("board:", std::string(NameOfKind(board.kind)), ",", board.columns, "x",
                      board.rows, ",", ShortestText(board.spacing_m));
}

}  // namespace rigcal
