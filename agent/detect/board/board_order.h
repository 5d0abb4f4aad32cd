// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "common/board/board.h"

namespace rigcal::agent {

// Brings the pixels of a board's points, which may begin at any end of the pattern, into the order
// that SeenBoard describes. `grey` is CV_8UC1.
void OrderBoard(const Board& board, const cv::Mat& grey, std::vector<Eigen::Vector2d>* pixels);

}  // namespace rigcal::agent
