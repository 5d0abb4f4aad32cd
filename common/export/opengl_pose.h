// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/export/rig_model.h"

namespace rigcal {

// rig_from_cam for programs whose cameras look along -z with y up (OpenGL, Blender, USD).
inline Eigen::Matrix4d RigFromOpenGlCamera(const ExportedCamera& camera) {
  Eigen::Matrix4d pose = camera.cam_from_rig.Inverse().Matrix();
  pose.col(1) = -pose.col(1);
  pose.col(2) = -pose.col(2);
  return pose;
}

}  // namespace rigcal
