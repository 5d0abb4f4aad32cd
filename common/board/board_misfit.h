// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "common/board/board.h"

namespace rigcal {

// How points that were found differ from those that were given, whatever frame each is in and how
// large: images say nothing about size.
struct ShapeMisfit {
  double rms_m = 0;    // of the distances, after the turn, shift and scale that make them least
  double worst_m = 0;  // the largest of them ...
  size_t worst = 0;    // ... and whose it is
};
// `given` and `found` have as many points, at least three; the same index is the same point.
ShapeMisfit CompareShapes(const std::vector<Eigen::Vector3d>& given,
                          const std::vector<Eigen::Vector3d>& found);

// What is not as the text of a board says, told from its points as cameras found them.
enum class MisfitCause : uint8_t {
  kUnknown = 0,    // none of the others explains most of it
  kGap = 1,        // of an April grid: the tags are further apart, or less far
  kStretch = 2,    // rows are further apart than columns, or less far
  kBend = 3,       // it is not flat
  kThickness = 4,  // its two sides are further apart, or less far
  kShift = 5,      // its two sides are not printed behind each other
};

struct BoardMisfit {
  MisfitCause cause = MisfitCause::kUnknown;
  // kGap: gap over side. kStretch: distance of rows over that of columns, 1 as given. kBend: how
  // far the middle is from the plane of the border, metres. kThickness: the distance of the sides,
  // metres. kShift: how far the back is from where it should be, along the board, metres.
  double found = 0;
  double explained_share = 0;  // of the sum of squared distances
  // By this factor the found points are larger than the board with that cause, whose spacing is as
  // given.
  double scale = 1;
};

// Of a board with two sides: how far the back is from where it should be, in the mean of its points
// and in frame `board`, where the found front lies best on the given one (with a scale). Metres.
Eigen::Vector3d BackOffset(const Board& board, const std::vector<Eigen::Vector3d>& found);

// Each cause is tried together with a scale.
BoardMisfit ExplainBoardMisfit(const Board& board, const std::vector<Eigen::Vector3d>& found);

}  // namespace rigcal
