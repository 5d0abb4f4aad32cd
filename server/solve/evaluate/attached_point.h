// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/geometry/rigid_transform.h"
#include "server/solve/evaluate/calibration_error.h"
#include "server/solve/evaluate/uncertainty.h"

namespace rigcal::server {

// A point that a camera carries along when its pose changes. The camera's own centre is one; a
// place it looks at says how far the view turns.

// How the point moves, in the rig frame, with the camera's pose: three rows, a column for each
// parameter of the covariance; metres per radian and metres per metre.
PointGainMatrix AttachedPointGain(const BundleProblem& problem, const RigUncertainty& rig,
                                  int camera, const Eigen::Vector3d& point_m);

// Of the camera's pose, in the order of its parameters: rotation, then translation. Empty: fixed.
std::vector<Eigen::Index> PoseRows(const RigUncertainty& rig, int camera);

// Of the cameras' centres, three rows each, after the best rigid motion has been taken out, that
// which the centres have in common with the places they carry along, each the middle of the waved
// volume. Which frame a rig has is a matter of choice; and the centres alone would leave two
// cameras nothing but their distance. Of the shape; square metres.
Eigen::MatrixXd FrameFreeCentreCovariance(const BundleProblem& problem, const RigUncertainty& rig,
                                          const Eigen::Vector3d& middle_m);

// By camera: one sigma (3-D) of that, metres.
std::vector<double> CentreSigmas(const Eigen::MatrixXd& centre_covariance);
std::vector<double> FrameFreeCentreSigmas(const BundleProblem& problem, const RigUncertainty& rig,
                                          const Eigen::Vector3d& middle_m);

// The same of the distances between two sets of poses of the same cameras. `middle_m` in the frame
// of `cam_from_rig`.
std::vector<double> FrameFreeCentreDistances(const std::vector<RigidTransform>& cam_from_rig,
                                             const std::vector<RigidTransform>& other_cam_from_rig,
                                             const Eigen::Vector3d& middle_m);

}  // namespace rigcal::server
