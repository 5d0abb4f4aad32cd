// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>

namespace rigcal::agent {

struct FittedCorner {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();  // by the residuals

  // One sigma along either axis, with what the model leaves besides noise.
  double Sigma() const;
};

// The point at which four squares of a chessboard meet, by least squares over the pixels of a
// window around `start_px`. The model of a pixel is
//   grey = o + g erf(d1 / (s sqrt 2)) erf(d2 / (s sqrt 2)),
// d1 and d2 being its distances from two lines through the corner, which begin along `row` and
// `column`, and s the blur of the edges. Unlike cornerSubPix, which intersects gradients and is
// 0.03 to 0.06 px off on sharp edges, it knows how pixels sample an edge: 0.01 px.
// `grey`: CV_8UC1; the centre of its first pixel is (0, 0). The window, 2 `half_px` + 1 pixels
// wide, shows these four squares alone. None: the window is not in the image, or shows no such
// corner.
std::optional<FittedCorner> FitCorner(const cv::Mat& grey, const Eigen::Vector2d& start_px,
                                      const Eigen::Vector2d& row, const Eigen::Vector2d& column,
                                      int half_px);

}  // namespace rigcal::agent
