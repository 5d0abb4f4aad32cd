// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "common/simulation/world/random_stream.h"

namespace rigcal {

// Something opaque and straight between camera and wand: a rectangle in the image.
struct OccludingBar {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();  // across the bar
  double half_width_px = 0;
  double half_length_px = 0;
  double reflectance = 0.1;  // share of the light that it throws back

  // Distance of a pixel from its nearest edge, positive inside.
  double InsidePx(const Eigen::Vector2d& pixel) const;
};

// A bar that covers some part of a disc, from a sliver to the whole of it.
OccludingBar RandomBar(const Eigen::Vector2d& centre_px, double radius_px, RandomStream* random);

}  // namespace rigcal
