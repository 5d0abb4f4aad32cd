// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/geometry/marker_rays.h"

namespace rigcal::server {

struct TargetPoseOptions {
  // Residuals beyond this count as this much, pixels.
  double truncation_px = 6;
  // A span triangulated from two cameras may be off by this share and still be a hypothesis.
  double span_share = 0.35;
};

// Finds the pose of the target at one instant from the poses of the cameras alone, whatever was
// there before: hypotheses from pairs of cameras and pairs of markers, the best by truncated
// reprojection error over all views, refined. `has_pose[c]` marks the cameras that may be used.
// `rays` as of UndistortMarkers; markers that are not used take no part. False, and the instant
// untouched, where no two such cameras see two markers in common that can be triangulated; of a
// target of one marker, that one. Its direction stays as it is.
// `inlier_count` and `marker_count`, if given: markers within the truncation, and all of them.
bool EstimateTargetPose(const BundleProblem& problem, const std::vector<bool>& has_pose,
                        const std::vector<Eigen::Vector2d>& rays, const TargetPoseOptions& options,
                        BundleInstant* instant, int* inlier_count = nullptr,
                        int* marker_count = nullptr);

}  // namespace rigcal::server
