// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/occluding_bar.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigcal {

double OccludingBar::InsidePx(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d away = pixel - centre_px;
  const Eigen::Vector2d along(-normal.y(), normal.x());
  return std::min(half_width_px - std::abs(away.dot(normal)),
                  half_length_px - std::abs(away.dot(along)));
}

OccludingBar RandomBar(const Eigen::Vector2d& centre_px, double radius_px, RandomStream* random) {
  OccludingBar bar;
  const double angle = random->Uniform(0, 2 * std::numbers::pi);
  bar.normal = {std::cos(angle), std::sin(angle)};
  bar.half_width_px = std::max(1.5, radius_px * random->Uniform(0.2, 1.8));
  bar.half_length_px = std::max(20.0, radius_px * random->Uniform(3, 8));
  // Its edge lies somewhere on the disc.
  const double edge_px = radius_px * random->Uniform(-0.9, 0.9);
  bar.centre_px = centre_px + (edge_px + bar.half_width_px) * bar.normal;
  bar.reflectance = random->Uniform(0.03, 0.4);
  return bar;
}

}  // namespace rigcal
