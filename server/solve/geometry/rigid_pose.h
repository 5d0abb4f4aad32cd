// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/geometry/rigid_transform.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// Points of a rigid target and where one camera sees them, as normalised coordinates without
// distortion.
struct RigidView {
  std::vector<Eigen::Vector3d> points_m;
  std::vector<Eigen::Vector2d> rays;
};

// Of an observation's used markers that have a ray (finite; `rays` as of UndistortMarkers).
RigidView ViewOf(const BundleProblem& problem, const std::vector<Eigen::Vector2d>& rays,
                 const BundleObservation& observation);

// Possible poses cam_from_target of a rigid target from one view. A plane seen from afar has two
// that fit nearly as well: both (IPPE, Collins and Bartoli 2014); points in space one (SQPnP,
// Terzakis and Lourakis 2020). Points nearly in a plane get both answers. Empty: fewer than four
// points, all nearly on one line, or none in front of the camera.
std::vector<RigidTransform> EstimateViewPoses(const RigidView& view);

// rig_from_target from at least three points that are not on one line (Umeyama 1991, without
// scale). None: fewer, or degenerate.
std::optional<RigidTransform> AlignRigidTarget(const std::vector<Eigen::Vector3d>& points_m,
                                               const std::vector<Eigen::Vector3d>& points_in_rig);

}  // namespace rigcal::server
