// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "agent/detect/board/board_detector.h"

namespace rigcal::agent {

// A marker that was found in an image, its corners to a few pixels.
struct FoundMarker {
  int id = 0;
  std::array<Eigen::Vector2d, 4> pixels;  // upper left, upper right, lower right, lower left
};

// The points of a board with markers, grown from one of `markers`: the points beside it are
// predicted by its homography, each is proved by FitPattern, and those beside what is known follow,
// row by row, each predicted by its nearest neighbours. Another marker begins where the first did
// not lead to the board. A point whose neighbours expect it elsewhere is not seen, and neither is a
// board whose markers show other bits than they should. `marker_parity`: as of MarkerCells. None:
// no marker leads to six points in two rows and columns.
std::optional<SeenBoard> GrowBoard(const Board& board, const cv::Mat& grey, int marker_parity,
                                   const std::vector<FoundMarker>& markers);

}  // namespace rigcal::agent
