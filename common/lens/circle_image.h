// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal {

// How far the centroid of a circle's image is from the image of the circle's centre, pixels. A
// circle that is seen at an angle is an ellipse whose centre lies beyond the image of its own, by
// about f (r / z)^2 sin t cos t, and a lens bends it further; so the rim is projected through the
// whole model as a polygon, and the centroid of its area is taken. `centre_in_board_m`: in the
// board's plane z = 0. False: a part of the circle has no image.
bool CircleOffset(const Intrinsics& intrinsics, const RigidTransform& cam_from_board,
                  const Eigen::Vector3d& centre_in_board_m, double radius_m,
                  Eigen::Vector2d* offset_px);

}  // namespace rigcal
