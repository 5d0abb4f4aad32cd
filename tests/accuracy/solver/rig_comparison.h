// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "common/calibration/calibration.h"
#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"
#include "common/simulation/world/simulated_world.h"
#include "server/solve/running/running_estimate.h"

namespace rigcal::accuracy {

// Cameras to triangulate with: true ones, estimated ones, or those of a calibration.
struct ComparedRig {
  struct Camera {
    std::string name;
    ImageSize image_size_px;
    RigidTransform cam_from_rig;
    Intrinsics intrinsics;
  };
  std::vector<Camera> cameras;
  double target_length_m = 0;  // gives the scale
};

ComparedRig RigOf(const SimulatedWorld& world);
ComparedRig RigOf(const server::RunningEstimate& estimate);  // without image sizes
ComparedRig RigOf(const CalibrationResult& result);

// to_from_from, by the centres of the cameras that both have; no scale.
Eigen::Isometry3d Align(const ComparedRig& from, const ComparedRig& to);

// So large are the errors of `found` in 95 % of the points (frame of `truth`), metres: their exact
// images in `truth`, triangulated with `found`, after the best rigid alignment and with the target
// of `found` as long as that of `truth` (uncertainty of the scale apart). Infinite: too few points
// can be triangulated.
double TriangulationErrorM(const ComparedRig& truth, const ComparedRig& found,
                           const std::vector<Eigen::Vector3d>& points_m);

// The points of the estimate's expected error, in the frame of `truth`.
std::vector<Eigen::Vector3d> PointsOf(const server::RunningEstimate& estimate,
                                      const ComparedRig& truth);

}  // namespace rigcal::accuracy
