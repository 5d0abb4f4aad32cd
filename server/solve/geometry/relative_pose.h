// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/geometry/rigid_transform.h"

namespace rigcal::server {

// One marker that two cameras show at one instant, as normalised coordinates without distortion.
struct PairMarker {
  int marker = 0;
  Eigen::Vector2d ray_a = Eigen::Vector2d::Zero();
  Eigen::Vector2d ray_b = Eigen::Vector2d::Zero();
};

// The markers that two cameras share in one instant; at least one.
using PairInstant = std::vector<PairMarker>;

struct RelativePoseOptions {
  std::vector<double> marker_positions_m;
  double focal_a_px = 1;  // mean focal lengths: turn normalised distances into pixels
  double focal_b_px = 1;
  double threshold_px = 3;  // of an epipolar distance, and of a marker's reprojection error
  uint32_t seed = 0;
  // 0 = the best pose, 1 = the second of those that differ, and so on; the last where there are
  // fewer.
  int rank = 0;
};

struct RelativePose {
  RigidTransform b_from_a;  // metric, from the marker spacing; of one marker: baseline of length 1
  int instant_count = 0;    // used
  int inlier_count = 0;     // of those: seen before both cameras, within the threshold, right size
  double median_px = 0;     // reprojection error of the rigid target over all markers used
};

// The pose between two cameras from shared markers: essential matrices of random samples of five
// (Nister 2004; each marker from another instant, as three on one wand lie on a line), scored by
// truncated Sampson distance; the best few are decomposed, given their metric scale by the target's
// spacing, and scored again with the rigid target, which distinguishes the true solution from the
// mirrored one and from the second one of a planar motion. The winner is
// refined with the rigid target. One marker has no size: cheirality and reprojection decide alone,
// and the baseline has length 1. Of many instants 200 are used. None where too few agree. Same
// input, same bits.
std::optional<RelativePose> EstimateRelativePose(const std::vector<PairInstant>& instants,
                                                 const RelativePoseOptions& options);

}  // namespace rigcal::server
