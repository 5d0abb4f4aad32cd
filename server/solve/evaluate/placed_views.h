// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// A camera's view of the target at an instant that the other cameras place.
struct PlacedView {
  size_t instant = 0;  // of the problem
  std::vector<Eigen::Vector3d> x_in_rig;
  std::vector<Eigen::Vector2d> centre_px;  // at the instant's time
  // Of the residuals x, y of one marker after the other, for them to have unit covariance: that of
  // the centres and, which the markers have in common, that of the target's pose by the others.
  Eigen::MatrixXd whitening;
};

// Large rigs of which each instant is seen by few cameras: there a camera's lens is looked at by
// itself, because those of all at once are the dearest of all solves.
bool LooksAtLensesAlone(const BundleProblem& problem);

// By camera, in the order of the instants, the views of `cameras` (by camera: whether they are
// asked for), of each at most about `max_views`, evenly chosen. Views of a rigid target, and those
// that fewer than two other cameras place, are left out, and so are markers that are rejected and
// lie farther than `far_px` from where the solution has them.
//
// The target's pose without a camera is one Gauss-Newton step from the pose that all cameras give
// it, in their normal equations without that camera's part: the time grows with the number of
// rows. Under the robust loss, whose weights follow, that is three quarters of the way to where a
// solve without the camera puts it. `problem`: solved.
std::vector<std::vector<PlacedView>> PlaceByOthers(const BundleProblem& problem,
                                                   const std::vector<bool>& cameras,
                                                   size_t max_views, double far_px);

}  // namespace rigcal::server
