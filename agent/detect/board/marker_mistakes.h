// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "common/board/board.h"

namespace rigcal::agent {

// What pictures show that do not show a board with markers as it was told: a sentence that says
// what to do, such as
//   in 9 of the 10 that were looked at again it is there mirrored: turn off the camera's mirroring
//   their markers are those of dictionary 4x4 (numbers up to 23): say 4x4_50 in --board
//   markers of 5x5_100 are there (numbers up to 23), but not where 10x7 squares have them ...
// Empty: they show no markers that anybody knows. `pictures`: CV_8UC1 or CV_8UC3.
std::string ExplainMissingMarkers(const Board& board, const std::vector<cv::Mat>& pictures);

}  // namespace rigcal::agent
