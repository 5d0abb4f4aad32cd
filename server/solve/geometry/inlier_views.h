// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/camera/intrinsics.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/geometry/triangulation.h"

namespace rigcal::server {

// A used marker as its camera saw it at the instant's time: moved along its image motion by what
// its clock is off.
struct InlierView {
  int camera;
  int marker;                 // of the target
  Eigen::Vector2d centre_px;  // distorted
  PointView view;             // the camera's pose and the undistorted ray
  bool has_ray;               // false: the camera's model has no inverse there, the ray is zero
};

// Of one instant, whether it is used or not, in the order of its observations. `intrinsics` by
// camera, see CurrentIntrinsics.
std::vector<InlierView> InlierViews(const BundleProblem& problem,
                                    const std::vector<Intrinsics>& intrinsics,
                                    const BundleInstant& instant);

}  // namespace rigcal::server
