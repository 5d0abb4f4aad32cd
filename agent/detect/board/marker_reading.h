// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "agent/detect/board/found_marker.h"
#include "common/board/board.h"

namespace rigcal::agent {

// Markers that are too small or blurred for OpenCV to tell black bits from white ones: the
// brightness of all bits together is compared with what each marker would show.
class MarkerReader {
 public:
  // The markers of a board.
  explicit MarkerReader(const Board& board);

  // Which marker `grey` (CV_8UC1) shows within these four corners, in their order in the image: the
  // one whose bits correlate best with what is there, if they do so by themselves and clearly
  // better than those of any other one. None: it is none of them.
  std::optional<FoundMarker> Read(const cv::Mat& grey, const MarkerCorners& corners) const;

 private:
  struct Code {
    int id = 0;
    size_t turns = 0;  // the corner of the image that is the marker's upper left
    // Whiteness of the bits by row, as the image shows them, less its mean and of norm 1: with the
    // border, and without it.
    Eigen::VectorXd all, inner;
  };
  Eigen::VectorXd Inner(const Eigen::VectorXd& all) const;

  bool is_tag_ = false;
  int bits_ = 0;  // along a side, with the border
  int border_ = 0;
  std::vector<Code> codes_;
};

}  // namespace rigcal::agent
