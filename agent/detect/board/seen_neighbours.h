// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "agent/detect/board/board_detector.h"
#include "agent/detect/board/local_plane.h"
#include "agent/detect/board/printed_pattern.h"

namespace rigcal::agent {

// The points of a board that an image shows next to a place of its print, the nearest first, at
// most so many. As long as fewer than six are seen, those of `instead` are among them.
std::vector<PatternPixel> SeenNeighbours(const PrintedPattern& pattern, const SeenBoard& seen,
                                         const Eigen::Vector2d& pattern_m, size_t most,
                                         const std::vector<PatternPixel>& instead = {});

}  // namespace rigcal::agent
