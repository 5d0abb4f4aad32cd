// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// The target at one instant, and how many markers it was found from.
struct TargetFit {
  BundleInstant instant;
  int inliers = 0;  // within the truncation
  int markers = 0;
};

// Finds the pose of the target at one instant from the poses of the cameras alone, whatever was
// there before: hypotheses from pairs of cameras and pairs of markers, the best by reprojection
// error over all views, refined. Residuals beyond `truncation_px` count as that much. `has_pose[c]`
// marks the cameras that may be used. `rays` as of UndistortMarkers; markers that are not used take
// no part. None where no two such cameras see two markers in common that can be triangulated; of a
// target of one marker, that one. Its direction stays as it is. A rigid target is found from any
// single view of four markers (rigid_pose.h), or from markers that cameras triangulate together;
// none where fewer than four markers agree; a part of it that is one point like a target of one
// marker.
std::optional<TargetFit> EstimateTargetPose(const BundleProblem& problem,
                                            const std::vector<bool>& has_pose,
                                            const std::vector<Eigen::Vector2d>& rays,
                                            double truncation_px, const BundleInstant& instant);

}  // namespace rigcal::server
