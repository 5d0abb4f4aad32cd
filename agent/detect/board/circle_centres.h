// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "common/board/board.h"

namespace rigcal::agent {

// Moves the roughly known centres of dark circles to the centroids of their darkness, each within
// half of the way to its nearest neighbour on the board. `grey` is CV_8UC1. What cannot be measured
// (at the border) stays. False: a place shows no circle, or two show one: OpenCV fills circles that
// it has not found from its neighbours, which in a bent or oblique grid can be half a distance off.
bool RefineCircles(const Board& board, const cv::Mat& grey, std::vector<Eigen::Vector2d>* pixels);

}  // namespace rigcal::agent
