// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/calibration/frame_options.h"
#include "common/camera/intrinsics.h"
#include "common/target/target.h"

namespace rigcal {

// How a part of the calibration is treated.
enum class Estimate : uint8_t {
  kDefault = 0,
  kFixed = 1,    // keep as given
  kRefined = 2,  // estimate
  kAuto = 3,     // estimate where held-out data says that it pays
};

// How the target's motion between rows is treated.
enum class TrajectoryChoice : uint8_t {
  kAuto = 0,          // a spline where interpolation leaves much out, and held-out data agree
  kInterpolated = 1,  // rows are moved to common instants along their image motion
  kSpline = 2,        // one path through time, of which every row is a part
};

// The measured distance between the optical centres of two cameras.
struct KnownDistance {
  static constexpr double kDefaultSigmaM = 0.002;

  std::string camera_a, camera_b;
  double distance_m = 0;  // > 0
  double sigma_m = 0;     // one sigma; 0 = kDefaultSigmaM

  double SigmaM() const { return sigma_m > 0 ? sigma_m : kDefaultSigmaM; }
  friend bool operator==(const KnownDistance&, const KnownDistance&) = default;
};

// What a calibration takes from the one that it derives from.
enum class SolveKind : uint8_t {
  kFull = 0,    // nothing
  kRefine = 1,  // all is solved, the parent with its covariance is a prior of the poses
  kRepair = 2,  // some cameras are solved, the poses of the others are the parent's
  kOrigin = 3,  // nothing is solved: the parent in another frame
  kScale = 4,   // nothing is solved: the parent with another scale
};

// The kinds that solve nothing.
inline bool ChangesFrameOnly(SolveKind kind) {
  return kind == SolveKind::kOrigin || kind == SolveKind::kScale;
}

// Which frame a full solve ends in.
enum class FrameChoice : uint8_t {
  kDefault = 0,         // that of the reference camera
  kOwn = 1,             // likewise, though the active calibration has a frame of its own
  kKeep = 2,            // that of the parent
  kKeepIfPossible = 3,  // likewise, else that of the reference camera
};

// Intrinsics of one camera, instead of those of its sessions.
struct CameraIntrinsics {
  std::string camera;
  ImageSize image_size_px;
  Intrinsics intrinsics;

  friend bool operator==(const CameraIntrinsics&, const CameraIntrinsics&) = default;
};

// What to solve.
struct CalibrationOptions {
  std::string reference_camera;  // its pose is the rig frame; empty: the lowest name
  Estimate intrinsics = Estimate::kDefault;
  Estimate time_offsets = Estimate::kDefault;
  Estimate marker_positions = Estimate::kDefault;
  TrajectoryChoice trajectory = TrajectoryChoice::kAuto;
  double sigma_px = 0;                 // one sigma of every centre, pixels; 0 = as observed
  double association_tolerance_s = 0;  // of two observations of one instant; 0 = from the periods
  uint32_t seed = 0;                   // of every random choice
  std::optional<KnownDistance> known_distance;  // the scale, for a target of one marker
  // Largest acceptable error, metres: with a larger predicted error the result is bad. 0: 1 % of
  // the median distance of the cameras from the middle of the waved volume.
  double accept_m = 0;

  std::string parent_id;  // the calibration it derives from; empty: none
  SolveKind kind = SolveKind::kFull;
  std::vector<std::string> only_cameras;      // of a repair: those that are solved
  std::vector<std::string> fixed_intrinsics;  // cameras that keep them while others are refined
  std::vector<CameraIntrinsics> given_intrinsics;  // instead of those of the sessions
  bool what_if = false;                            // made to be looked at, never active
  // Of a what-if only.
  std::vector<std::string> without_cameras, without_sessions;
  double from_s = 0, to_s = 0;           // after a camera's first row of a session; to_s 0: the end
  std::optional<Target> assumed_target;  // for that of the sessions
  std::optional<OriginRequest> origin;   // of kOrigin
  std::optional<ScaleRequest> scale;     // of kScale
  FrameChoice frame = FrameChoice::kDefault;

  // The parent is needed for the solve.
  bool NeedsParent() const {
    return kind != SolveKind::kFull || frame == FrameChoice::kKeep ||
           frame == FrameChoice::kKeepIfPossible;
  }

  friend bool operator==(const CalibrationOptions&, const CalibrationOptions&) = default;
  absl::Status Validate() const;
};

}  // namespace rigcal
