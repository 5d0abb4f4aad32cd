// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"
#include "common/target/target.h"
#include "server/associate/camera_track.h"
#include "server/solve/rig/problem_builder.h"
#include "server/solve/running/camera_groups.h"
#include "server/solve/running/expected_error.h"
#include "server/solve/running/wave_advice.h"

namespace rigcal::server {

// What of an estimate the next one begins with. Poses by camera name, offsets by clock.
struct EstimateStart {
  struct Camera {
    std::string name;
    RigidTransform cam_from_rig;
    Intrinsics intrinsics;
  };
  std::vector<Camera> cameras;  // ascending by name
  std::vector<ClockCorrection> clocks;
  std::vector<double> marker_positions_m;
  int round = 0;  // how many estimates there have been

  bool empty() const { return cameras.empty(); }
};

// Rows of a session that still captures, as they are so far.
struct RunningInput {
  Target target;
  std::vector<CameraTrack> tracks;
  // Share of all observations that is in `tracks`, 0 to 1: rows that have been thinned out count
  // for what is expected of a calibration of all of them.
  double data_share = 1;
  EstimateStart start;  // empty: from nothing
  // At most about so many views (an instant in one camera) are solved, evenly chosen in time.
  int max_views = 4'000;
  size_t max_grid_points = 1000;
  bool advise = true;
  bool check_held_out = true;
  const std::atomic<bool>* cancelled = nullptr;
};

struct EstimatedCamera {
  std::string name;
  RigidTransform cam_from_rig;
  double time_offset_s = 0;  // relative to the median clock
  double time_offset_sigma_s = 0;
  double reprojection_rms_px = 0;  // of the inliers
  double focal_length_px = 0;
  bool lens_disagrees = false;  // the intrinsics that were given are not those of this camera
};

// A solution on three quarters of the time tried on the rest; another quarter in each round. Both
// are root mean squares of leave-one-camera-out errors, or of reprojection errors where no marker
// is seen by three cameras.
struct HeldOutCheck {
  double rms_px = 0;           // on blocks of time that were held out
  double expected_rms_px = 0;  // on as many blocks that were solved
  bool agrees = false;
};

// The calibration as it would be if the session ended now, solved quickly: no search for what is
// wrong, no choice of models but that of the intrinsics. The given ones are kept until they are
// seen to be wrong (given_intrinsics.h).
struct RunningEstimate {
  int instant_count = 0;  // of all data that is there
  bool intrinsics_refined = false;
  bool scale_known = true;
  std::vector<EstimatedCamera> cameras;    // ascending by name
  std::vector<double> marker_positions_m;  // as measured
  double scale_sigma_rel = 0;
  WavedGrid grid;
  ExpectedError error;
  std::optional<HeldOutCheck> held_out;  // none: too little data
  std::vector<WaveAdvice> advice;
  std::vector<Eigen::Vector3d> wand_m;  // markers at the newest instant
  EstimateStart next;
};

struct RunningOutcome {
  std::optional<RunningEstimate> estimate;
  absl::Status problem;         // OK: nothing was wrong, also where there is too little to solve
  std::vector<PairNeed> needs;  // most urgent first; empty: all cameras are joined
};

// The largest group of cameras that are joined by pairs with enough common instants is solved; what
// would join the others is in `needs`. Begins where the last estimate ended, and from nothing where
// that does not fit (any more).
RunningOutcome EstimateNow(RunningInput input);

}  // namespace rigcal::server
