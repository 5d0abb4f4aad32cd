// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal::server {

// How the pose of one camera differs between two calibrations.
struct CameraDifference {
  enum class Verdict : uint8_t {
    kSame = 1,     // within the uncertainty of both
    kMoved = 2,    // more than that
    kUnknown = 3,  // the uncertainty would hide a move of kHiddenPx, or others moved too
  };
  std::string camera;
  Verdict verdict = Verdict::kUnknown;
  double translation_m = 0, translation_sigma_m = 0;  // of its centre, along the difference
  double rotation_rad = 0, rotation_sigma_rad = 0;    // about the axis of the difference
  double centre_px = 0, centre_sigma_px = 0;          // of RigDifference::centre_m in its image
  double sigmas = 0;                                  // of the whole pose, as of one normal value
  double time_offset_s = 0, time_offset_sigma_s = 0;  // against the others; sigma 0: not known
};

struct RigDifference {
  std::vector<CameraDifference> cameras;   // in both, sorted
  std::vector<std::string> frame_cameras;  // did not move: the frames are aligned over them
  std::vector<std::string> only_in_a, only_in_b;
  RigidTransform b_from_a;                             // rig frames
  double scale_difference = 0;                         // lengths of B by those of A, minus 1
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();  // frame of A
  std::string problem;  // why it cannot be told which cameras moved; empty: it can

  std::vector<std::string> Moved() const;
};

// A hidden move of so much at the volume's middle makes a verdict of no worth.
inline constexpr double kHiddenPx = 2;

// Where both have the same intrinsics of a camera, these are taken as exact: the monitor solves
// with those of the calibration that it looks after. Lenses that A has refined itself are allowed
// an error of 0.25 px between two waves.
//
// Finds the cameras that did not move: the largest set whose poses in A and B are one rigid body
// within the joint covariance of both. A further camera is taken out of it where the squared
// Mahalanobis distance falls by more than a chance of 1e-7 allows; where two sets of one size would
// do, or no two cameras agree, `problem` says so. The rig frames, and the scales within their
// sigmas, are aligned over that set.
// FAILED_PRECONDITION: fewer than two cameras in common; errors of PosesOf.
absl::StatusOr<RigDifference> CompareRigs(const CalibrationResult& a, const CalibrationResult& b);

}  // namespace rigcal::server
