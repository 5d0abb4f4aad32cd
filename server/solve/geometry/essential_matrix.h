// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/geometry/rigid_transform.h"
#include "server/solve/geometry/relative_pose.h"

namespace rigcal::server {

// The essential matrices between cameras a and b (x_b^T E x_a = 0 for normalised coordinates) that
// agree best with what both saw, four at most, the best first, each of norm 1: from random samples
// of five markers (Nister 2004, "An efficient solution to the five-point relative pose problem"),
// scored by truncated Sampson distances. At least five instants, each with a marker.
std::vector<Eigen::Matrix3d> SampleEssentials(const std::vector<PairInstant>& instants,
                                              const RelativePoseOptions& options);

// The four poses b_from_a that an essential matrix stands for, with a baseline of length 1.
std::vector<RigidTransform> DecomposeEssential(const Eigen::Matrix3d& essential);

}  // namespace rigcal::server
