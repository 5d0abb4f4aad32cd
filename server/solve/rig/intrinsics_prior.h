// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/camera/camera_description.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// Uncertainty of given intrinsics, one sigma each: what a careful chessboard
// calibration of a lens that was touched since leaves open.
struct IntrinsicsPrior {
  double focal_share = 0.02;   // of fx and of fy
  double centre_share = 0.01;  // of the image's width, for cx and cy
  double radial = 0.05;        // k1, k2 (and the fisheye's k1, k2)
  double radial_high = 0.1;    // higher orders
  double tangential = 0.002;   // p1, p2
};

// Of intrinsics that nothing is known of: a wrong file, a lens that was changed.
inline constexpr IntrinsicsPrior kWideIntrinsicsPrior = {.focal_share = 0.2,
                                                         .centre_share = 0.05,
                                                         .radial = 0.2,
                                                         .radial_high = 0.3,
                                                         .tangential = 0.01};

// Frees the intrinsics of a camera under this prior around the given ones.
void SetIntrinsicsPrior(const CameraDescription& description, BundleCamera* camera,
                        const IntrinsicsPrior& prior = {});

}  // namespace rigcal::server
