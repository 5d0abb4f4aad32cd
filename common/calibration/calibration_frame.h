// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "common/calibration/frame_options.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal {

// How well a point fits a new frame.
struct PointResidual {
  std::string name;
  double residual_m = 0;  // distance from the plane (signed), or from the known point
  double sigma_m = 0;     // of the point by itself
};

// How the frame of a calibration came about.
struct CalibrationFrame {
  FrameSource source = FrameSource::kReferenceCamera;
  std::string calibration_id;   // whose frame it was before; kKept: whose frame it is
  RigidTransform new_from_rig;  // this frame from that one; kKept: from the reference camera's
  // One sigma about and along the new axes; it is in the cameras' covariance.
  Eigen::Vector3d rotation_sigma_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_sigma_m = Eigen::Vector3d::Zero();
  double residual_rms_m = 0;
  std::vector<PointResidual> residuals;  // at most kMaxPointResiduals
  uint32_t residual_count = 0;           // of all
  std::string lowest_camera;
  double lowest_camera_m = 0;        // above z = 0
  std::vector<std::string> cameras;  // kKept: over which the frames were aligned
  std::string problem;               // kNotKept: why

  // It is not that of the reference camera.
  bool IsOwn() const {
    return source != FrameSource::kReferenceCamera && source != FrameSource::kNotKept;
  }
};

inline constexpr size_t kMaxPointResiduals = 200;

// How the scale of a calibration came about.
struct ScaleSourceReport {
  std::string name;
  double own_change = 0, own_sigma = 0;            // relative
  double from_others = 0, from_others_sigmas = 0;  // relative, and in sigmas
};
struct CalibrationScale {
  std::string calibration_id;  // whose scale it was before
  double factor = 1;           // of every length
  double sigma_rel = 0;
  std::vector<ScaleSourceReport> sources;
};

}  // namespace rigcal
