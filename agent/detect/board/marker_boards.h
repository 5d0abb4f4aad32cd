// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "agent/detect/board/board_detector.h"

namespace rigcal::agent {

// A ChArUco board or an April grid in a picture (CV_8UC1): OpenCV finds markers, and GrowBoard the
// points around them. Where no marker that OpenCV reads leads to the board, those that it found and
// could not read are read by their brightness (MarkerReader). The corners of OpenCV's markers only
// begin: those of an April grid are 2 px off, because black squares touch them, and ChArUco's are
// half a pixel off in OpenCV 4.6. Of a board with two sides the points of that side are seen whose
// markers are. None: it does not show six points in two rows and columns, or its
// markers are those of another board.
std::optional<SeenBoard> FindMarkerBoard(const Board& board, const cv::Mat& grey);

}  // namespace rigcal::agent
