// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// In the pixels that a measurement of a marker reads; and a share of a stick that is surely seen.
inline constexpr double kWorkOfStick = 5, kStickSeen = 0.7;

// How much of a stick is seen along the line between two points, 0 to 1: the share of pieces of the
// line that differ from both of their sides alike, as do the others. 0 where too little of the line
// lies in the image. `radius_px`: of a sphere of the wand, whose stick is thinner than that. Reads
// some hundred pixels.
double StickShare(const ImageView& image, const Eigen::Vector2d& from_px,
                  const Eigen::Vector2d& to_px, double radius_px);

// The same between two spheres, with a distance from the outlines. None where nothing is between.
std::optional<double> StickBetween(const ImageView& image, const Eigen::Vector2d& a_px,
                                   double a_radius_px, const Eigen::Vector2d& b_px,
                                   double b_radius_px, double radius_px);

}  // namespace rigcal::agent
