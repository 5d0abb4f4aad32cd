// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "server/solve/geometry/triangulation.h"

namespace rigcal::server {

// The pose from which a camera sees known points: OpenCV's EPnP within RANSAC on up to 600 of them,
// evenly chosen. `threshold`: of an inlier, in rays. None with fewer than 30 points, or where fewer
// than `min_share` of them agree.
std::optional<RigidTransform> Resect(const std::vector<PointAndRay>& sights, double threshold,
                                     double min_share = 0.5);

}  // namespace rigcal::server
