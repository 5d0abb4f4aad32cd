// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/solve/calibrate.h"

namespace rigcal::accuracy {

struct UntilOptions {
  int camera_count = 6;
  double duration_s = 120;  // at most
  double until_mm = 0.5;
  // Of the described lenses: 1 is 0.2 % of the focal length and 2 px of the centre, one sigma.
  double lens_error = 0;
  bool guided = false;  // the person goes where told; else anywhere
  int end_views = 0;  // the trial ends at the target, and not before all cameras have so many views
};

// The running estimate at one time of the wave.
struct UntilStep {
  double time_s = 0;
  int poorest_views = 0;    // wand views of the camera that has fewest
  double predicted_mm = 0;  // ExpectedError::p95_m; 0: no estimate of all cameras
  double true_mm = 0;       // so large is the error in 95 % of the points, all data solved
  bool agrees = false;      // the held-out check
  double solve_s = 0;       // CPU time of the estimate
};

struct UntilTrial {
  absl::Status status;
  std::vector<UntilStep> steps;
  double calibrated_mm = 0;  // as true_mm, of the calibration of the data up to the target; 0: none

  // Index of the first step at which a session would end; -1: none.
  int StopAt(double until_mm) const;
  // Of the first step at which the poorest camera has so many views.
  int StepWithViews(int views) const;
};

// A rig of free-running clocks (one camera 8 ms off) and a person who waves for two seconds at a
// time.
UntilTrial RunUntilTrial(const UntilOptions& options, uint32_t seed);

// A recording at its own speed, two seconds at a time. `true_mm` is the difference from the
// calibration of the whole recording, at the points of the estimate; until the first step after
// all targets are reached.
absl::StatusOr<UntilTrial> ReplayRecording(const server::CalibrationInput& recording,
                                           double lowest_target_mm);

}  // namespace rigcal::accuracy
