// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <map>
#include <opencv2/core.hpp>
#include <vector>

#include "agent/detect/board/found_marker.h"
#include "agent/detect/board/local_plane.h"
#include "common/board/board.h"
#include "common/board/marker_cells.h"

namespace rigcal::agent {

// What a part of an image would show of a printed pattern.
struct PatternPatch {
  cv::Mat1f white;       // 0 black, 1 white; as wide as high
  double per_pixel = 0;  // places of `white` along a pixel of the image
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  // what the place in the middle shows

  // Of an offset from the centre in pixels, on either axis: column or row of `white`.
  double IndexOf(double offset_px) const { return per_pixel * offset_px + 0.5 * (white.cols - 1); }
};

// The black and white of a board with markers. Frame `pattern`: metres, x to the right and y
// downwards from the upper left of the print.
class PrintedPattern {
 public:
  // Of one side of a board: `board` has one side, of which this may be the back (with the next
  // markers). `marker_parity`: as of MarkerCells.
  PrintedPattern(const Board& board, BoardSide side, int marker_parity);

  // The points of Board::Points(), by index.
  const std::vector<Eigen::Vector2d>& points() const { return points_; }
  // Of each marker by its number, the corners: upper left, upper right, lower right, lower left.
  const std::map<int, MarkerCorners>& markers() const { return markers_; }

  // `half_px`: from the centre of the patch, the image of `pattern_m`, to its sides. `blur_px`: one
  // sigma of a lens. Around the print it is white. Empty: the plane is seen edge-on.
  PatternPatch Show(const LocalPlane& plane, const Eigen::Vector2d& pattern_m, double half_px,
                    double blur_px, double per_pixel) const;

 private:
  std::vector<BlackCell> cells_;
  std::vector<Eigen::Vector2d> points_;
  std::map<int, MarkerCorners> markers_;
};

}  // namespace rigcal::agent
