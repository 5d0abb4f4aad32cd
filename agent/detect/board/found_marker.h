// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>

namespace rigcal::agent {

using MarkerCorners = std::array<Eigen::Vector2d, 4>;

// A marker that was found in an image, its corners to a few pixels.
struct FoundMarker {
  int id = 0;
  MarkerCorners pixels;  // upper left, upper right, lower right, lower left
};

// OpenCV's corners of a tag of an April grid are off along its diagonals, because the squares there
// touch them: by how much outwards they are tried, pixels.
inline constexpr double kTagShiftsPx[] = {0, -1.5, 1.5, -3};

inline double LongestSide(const MarkerCorners& corners) {
  double longest = 0;
  for (size_t i = 0; i < 4; ++i) {
    longest = std::max(longest, (corners[(i + 1) % 4] - corners[i]).norm());
  }
  return longest;
}

inline Eigen::Vector2d MiddleOf(const MarkerCorners& corners) {
  return 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]);
}

}  // namespace rigcal::agent
