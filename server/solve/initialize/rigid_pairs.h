// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/geometry/relative_pose.h"

namespace rigcal::server {

struct RigidPairOptions {
  double threshold_px = 3;  // of a marker's reprojection error
  // 0 = the best pose, 1 = the second of those that differ, and so on; the last where there are
  // fewer.
  int rank = 0;
};

// The pose b_from_a of two cameras that see a rigid target at the same instants: hypotheses from
// the target's pose in both views of one instant (rigid_pose.h), scored by where the other
// instants' targets, as a sees them, come out in b; the best few are refined over the instants by
// bundle adjustment, which also decides between the two poses of a plane. `rays` as of
// UndistortMarkers. Of many instants 60 are used. None where fewer than three agree.
std::optional<RelativePose> EstimateRigidPairPose(const BundleProblem& problem,
                                                  const std::vector<Eigen::Vector2d>& rays, int a,
                                                  int b, const RigidPairOptions& options);

}  // namespace rigcal::server
