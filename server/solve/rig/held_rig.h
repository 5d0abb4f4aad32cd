// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/geometry/rigid_transform.h"

namespace rigcal::server {

struct BundleProblem;

// Cameras of a rig whose poses are known from an earlier calibration and not estimated.
struct HeldRig {
  // By camera of the index; none: it is solved.
  std::vector<std::optional<RigidTransform>> cam_from_rig;
  // Of the held poses, six rows for each camera of the index: rotation vector in the camera frame
  // (applied from the left) and translation of cam_from_rig. Zero for cameras that are solved, and
  // for the reference camera of the solve unless the frame is another one.
  Eigen::MatrixXd covariance;
  bool keeps_frame = false;    // the frame is that of no camera: all of them have a covariance
  double scale_sigma_rel = 0;  // of all lengths

  bool Holds(size_t camera) const {
    return camera < cam_from_rig.size() && cam_from_rig[camera].has_value();
  }
};

// Takes a problem that was just initialized from its own frame, with its own errors, into that of
// the held cameras: by the mean rotation (L2 chordal) and the mean shift of their centres. Held
// cameras are put where they are known to be, the others moved along, and the instants placed anew.
void MoveToHeld(const HeldRig& held, BundleProblem* problem);

}  // namespace rigcal::server
