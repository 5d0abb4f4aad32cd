// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// Whether a disc of `radius_px` around `centre_px` may be a whole marker of the colour and
// brightness `core` (grey levels, by channel), though nothing found it: the middle looks like the
// others', and what is around it differs from the middle in most directions. As a chi-squared;
// none: it is not, or not wholly in the image. `work`: pixels that may be read, less those that
// were.
std::optional<double> ThirdMarkerCost(const ImageView& image, const Eigen::Vector2d& centre_px,
                                      double radius_px, const Eigen::Vector3f& core, double* work);

}  // namespace rigcal::agent
