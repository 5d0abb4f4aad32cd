// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/board/board.h"
#include "common/camera/intrinsics.h"

namespace rigcal::agent {

// Moves the centroids of the images of a board's circles to the images of their centres; nothing of
// another board.
void CorrectCircles(const Board& board, const Intrinsics& intrinsics,
                    std::vector<Eigen::Vector2d>* pixels);

// One sigma of a point along an axis, by the third differences along rows and columns, which are
// small for a plane in perspective: their variance is 20 times that of a point (1 + 9 + 9 + 1).
double PointSigma(const Board& board, const std::vector<Eigen::Vector2d>& pixels);

}  // namespace rigcal::agent
