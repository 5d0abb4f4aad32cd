// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "agent/detect/board/board_detector.h"
#include "agent/detect/board/found_marker.h"

namespace rigcal::agent {

// The points of one side of a board with markers (`board` has one side, this one), grown from one
// of `markers`: the points beside it are predicted by its homography, each is proved by FitPattern,
// and those beside what is known follow, row by row, each predicted by its nearest neighbours.
// Another marker begins where the first did not lead to the board. A point whose neighbours expect
// it elsewhere is not seen, and neither is a board whose markers show other bits than they should.
// A ChArUco board of an even number of rows of squares may have the layout that OpenCV drew
// before 4.6. None: no marker leads to six points in two rows and columns.
std::optional<SeenBoard> GrowBoard(const Board& board, BoardSide side, const cv::Mat& grey,
                                   const std::vector<FoundMarker>& markers);

}  // namespace rigcal::agent
