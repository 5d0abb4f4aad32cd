// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/board/board.h"

namespace rigcal {

// A sheet with a board as it is printed, millimetres. The pattern stands in the middle of the width
// with a white margin (quiet zone) around it; below are a ruler and the board's text.
struct BoardSheet {
  double pattern_width_mm = 0;   // black and white squares, or from rim to rim of the circles
  double pattern_height_mm = 0;  // likewise
  double margin_mm = 0;
  double width_mm = 0;
  double height_mm = 0;
  double circle_diameter_mm = 0;  // 0: a checker
  double first_point_x_mm = 0;    // of point 0 on the sheet
  double first_point_y_mm = 0;    // likewise
};
BoardSheet SheetOf(const Board& board);

// The sheet as an SVG file to scale: one unit is a millimetre. The ruler is 100 mm long, to check
// the print. `board` must be valid. The sheets of a board with two sides are of one size and have
// crosses in their corners, which lie on each other where the back is turned about its vertical
// middle line: Board says how the frames of both sides go together.
std::string BoardSvg(const Board& board, BoardSide side = BoardSide::kFront);

// For people, several lines: counts, sizes, the paper it needs, how to print it.
std::string DescribeBoard(const Board& board);

}  // namespace rigcal
