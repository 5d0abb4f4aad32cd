// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal::client {

// A camera's pose in two frames that differ by an unknown rigid motion.
struct PosePair {
  RigidTransform cam_from_a;
  RigidTransform cam_from_b;
};

// b_from_a that brings the camera centres together best in the sense of least squares, without
// scale (Kabsch 1976; Umeyama 1991, section III with c = 1). What the centres leave open (one or
// two cameras, all on one line) is decided by the cameras' orientations, which otherwise weigh a
// millionth of the mean squared distance from the centroid per camera: nothing, for a rig whose
// centres decide. INVALID_ARGUMENT: no cameras, or values that are not finite.
absl::StatusOr<RigidTransform> AlignRigidly(const std::vector<PosePair>& cameras);

// How long b's lengths are in a's: the factor of the similarity that brings the camera centres
// together best (Umeyama 1991, equation 42), for an a whose unit is not known. INVALID_ARGUMENT: as
// AlignRigidly; centres of a that are all in one place; a similarity that would turn a inside out.
absl::StatusOr<double> FindScale(const std::vector<PosePair>& cameras);

// What is left of one camera's difference after the alignment.
struct PoseDifference {
  double position_m = 0;
  double rotation_deg = 0;
};
PoseDifference DifferenceAfter(const RigidTransform& b_from_a, const PosePair& camera);

}  // namespace rigcal::client
