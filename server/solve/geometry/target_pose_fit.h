// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// Normalised coordinates without distortion of each marker of a problem (same index), NaN where the
// camera's model has no inverse. With the problem's current intrinsics; the markers' own time shift
// is not applied.
std::vector<Eigen::Vector2d> UndistortMarkers(const BundleProblem& problem);

// The same for the markers of one instant, into `rays`; `intrinsics` by camera.
void UndistortInstant(const BundleProblem& problem, const std::vector<Intrinsics>& intrinsics,
                      const BundleInstant& instant, std::vector<Eigen::Vector2d>* rays);

struct TargetPoseFitOptions {
  // Residuals beyond this count as this much, pixels.
  double truncation_px = 6;
  // A span triangulated from two cameras may be off by this share and still be a hypothesis.
  double span_share = 0.35;
};

// Finds the pose of the target at one instant from the poses of the cameras alone, whatever was
// there before: hypotheses from pairs of cameras and pairs of markers, the best by truncated
// reprojection error over all views, refined. `has_pose[c]` says which cameras may be used.
// `rays` as of UndistortMarkers; markers that are not used take no part. False, and the instant
// untouched, where no two such cameras see two markers in common that can be triangulated; of a
// target of one marker, that one. Its direction stays as it is.
// `inlier_count` and `marker_count`, if given: markers within the truncation, and all of them.
bool FitWand(const BundleProblem& problem, const std::vector<bool>& has_pose,
             const std::vector<Eigen::Vector2d>& rays, const TargetPoseFitOptions& options,
             BundleInstant* instant, int* inlier_count = nullptr, int* marker_count = nullptr);

}  // namespace rigcal::server
