// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "agent/detect/board/board_detector.h"

namespace rigcal::agent {

// A ChArUco board or an April grid in a picture (CV_8UC1): OpenCV finds the markers, FitCorner the
// corners beside them. The corners of OpenCV's markers are not taken: those of an April grid are 2
// px off, because black squares touch them, and ChArUco's are half a pixel off in OpenCV 4.6. A
// corner of a ChArUco board counts where two markers beside it agree about its place; both layouts
// that OpenCV has had for boards of an even number of rows are tried. Of a board with two sides
// the points of that side are seen whose markers are. None: fewer than four tags of
// an April grid, or fewer than six corners, or all of them on a line.
std::optional<SeenBoard> FindMarkerBoard(const Board& board, const cv::Mat& grey);

}  // namespace rigcal::agent
