// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "absl/status/status.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/initialize/overlap_graph.h"

namespace rigcal::server {

// Poses of all cameras of a problem whose target is one marker, from relative poses with baselines
// of unknown length. The fixed camera's pose stays as it is. Two cameras alone say nothing about
// lengths, so the scale is carried from camera to camera by instants that three of them share: of a
// camera to be joined, by what it and one that is joined triangulate against what the joined ones
// do. The baseline of an estimate has length 1. `rays` are the markers' normalised coordinates, by
// index.
//
// In the end the cameras of the problem's `distance` have it; where it has none, the camera
// farthest from the fixed one is put at distance 1, and `distance` is set to say so.
//
// FAILED_PRECONDITION: the cameras are not connected, or not in scale; names the groups and the
// three cameras which would best join them. Errors of `estimate` are passed on.
absl::Status ChainPointPoses(const OverlapGraph& graph, const std::vector<Eigen::Vector2d>& rays,
                             const PairEstimate& estimate, BundleProblem* problem);

}  // namespace rigcal::server
