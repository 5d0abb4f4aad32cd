// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "common/board/board.h"

namespace rigcal::agent {

// A board with other counts than was said.
struct CountsGuess {
  Board board;
  int pictures = 0;  // in which it was found
};

// Which counts a person may have meant whose board was found in none of these pictures (CV_8UC1 or
// CV_8UC3). A chessboard may have any; circles one more or less in a row or column, or both
// swapped. The one that is found most often, the larger one of two. None: no such board was found.
std::optional<CountsGuess> GuessCounts(const Board& board, const std::vector<cv::Mat>& pictures);

}  // namespace rigcal::agent
