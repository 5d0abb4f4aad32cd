// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "agent/detect/event/disc_splitter.h"

namespace rigcal::agent {

// Pixels that lit up together.
struct BurstShape {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second_moment_px2 = Eigen::Matrix2d::Zero();  // about the centre
  int area_px = 0;

  double RadiusPx() const;  // of a disc of that area
  // Longer than one marker is: a disc that moves by its radius is not.
  bool IsLong() const;
};

// Of all pixels; at least one.
BurstShape ShapeOf(const PixelList& pixels);

// Of one marker: pixels further out than the ellipse of the same moments reaches are something else
// that lit up beside it (a lamp, an edge, noise) and are taken out of the list. Where that would be
// more than a third nothing is: it is no marker with something beside it.
BurstShape MarkerShapeOf(PixelList* pixels);

}  // namespace rigcal::agent
