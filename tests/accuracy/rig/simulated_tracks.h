// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/calibration/calibration.h"
#include "common/simulation/world/simulated_world.h"

namespace rigcal::accuracy {

// Of one frame of one camera.
struct RowGroundTruth {
  std::vector<bool> is_outlier;  // by marker, as labelled in the row
  bool flipped = false;          // the labels of the row
};
// By camera and frame.
std::vector<std::vector<RowGroundTruth>> MakeRowGroundTruth(const SimulatedWorld& world);

// Index of the world's camera of this name; -1 for none.
int CameraIndex(const SimulatedWorld& world, const std::string& name);

// Error of one camera's pose in the gauge of CameraUncertainty: the reference camera's pose is the
// rig frame.
struct PoseError {
  Eigen::Vector3d rotation_rad =
      Eigen::Vector3d::Zero();  // estimated rotation = exp(rotation_rad) * true one
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  // of the camera's centre, in the rig frame
};
PoseError ErrorOf(const RigidTransform& estimated_cam_from_rig,
                  const RigidTransform& true_cam_from_rig);

// The pose that a perfect calibration would give: cam_from_rig with the rig frame of `reference`.
RigidTransform TruePose(const SimulatedWorld& world, int camera, int reference);

}  // namespace rigcal::accuracy
