// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "common/camera/intrinsics.h"

namespace rigcal {

// What is true of one marker's sphere at mid exposure.
struct MarkerGroundTruth {
  bool inside = false;  // the lens images the sphere's centre, and within the image
  // Projection of the sphere's centre (not the centre of its image).
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  double radius_px = 0;  // of its image, mean
};

MarkerGroundTruth TruthOf(const Intrinsics& intrinsics, const ImageSize& image_size,
                          const Eigen::Vector3d& centre_in_cam_m, double radius_m);

}  // namespace rigcal
