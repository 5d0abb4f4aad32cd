// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>

#include "agent/detect/board/local_plane.h"
#include "agent/detect/board/printed_pattern.h"

namespace rigcal::agent {

struct PatternFitOptions {
  bool is_rough = false;  // to a tenth of a pixel, without a covariance
  int half_px = 6;        // pixels from the middle of the window to its sides
  int search_px = 0;      // whole pixels to either side that are tried first
  int drawings = 1;       // the print is drawn again where the last fit found it
  // How far a fit may go from where it begins, one sigma each.
  double move_px = 1;          // of the centre
  double stretch = 0.05;       // of a length, or of an angle in radians
  double perspective = 0.001;  // of the stretch, for each pixel
  double blur_share = 0.2;     // of the blur
};

struct FittedPattern {
  LocalPlane plane{Eigen::Matrix3d::Identity()};
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  // Of the centre, by the residuals; of a rough fit not known.
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
  double blur_px = 0;
  double correlation = 0;  // of the window with what it should show; 1: noise and model are exact
  double contrast = 0;     // grey levels from black to white

  // One sigma of the centre along either axis, with what the model leaves besides noise.
  double Sigma() const;
};

// Where an image shows `pattern_m` of a print, by least squares over the pixels of a window around
// the place where `plane` shows it. The model of a pixel is
//   grey = o + g white(W(pixel)),
// white being what the print would look like at `plane` with a lens of `blur_px`, and W a
// homography near identity: it moves, stretches and tilts. The blur is fitted, too (the derivative
// of a Gaussian by its sigma is sigma times the Laplacian). All that is printed in the window is
// part of the model, so that it may show the bits of markers, unlike that of FitCorner.
// `grey`: CV_8UC1; the centre of its first pixel is (0, 0). A window is cut by the border of the
// image. None: its middle is not in the image, or there is nothing in it.
std::optional<FittedPattern> FitPattern(const cv::Mat& grey, const PrintedPattern& pattern,
                                        const LocalPlane& plane, const Eigen::Vector2d& pattern_m,
                                        double blur_px, const PatternFitOptions& options);

}  // namespace rigcal::agent
