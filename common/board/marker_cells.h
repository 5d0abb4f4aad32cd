// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/board/board.h"

namespace rigcal {

// A black square of a printed pattern, metres, x to the right and y downwards from the pattern's
// upper left.
struct BlackCell {
  double x_m = 0, y_m = 0;
  double side_m = 0;
};

// What is black on a board with markers: the squares of a ChArUco board and the bits of its markers
// (whose upper left square is black), or the tags of an April grid, with a border of two bits, and
// the squares between their corners. Of the back of a board with two sides, as it is seen from
// behind: the same with the next markers. `marker_parity`: the markers of a ChArUco board are in
// the squares whose column and row add up to an odd number (1, and the upper left square is black),
// or to an even one (0: boards of an even number of rows that OpenCV drew before 4.6).
std::vector<BlackCell> MarkerCells(const Board& board, BoardSide side = BoardSide::kFront,
                                   int marker_parity = 1);

// OpenCV's number of a ChArUco board's dictionary, or of an April grid's.
int DictionaryOf(const Board& board);

}  // namespace rigcal
