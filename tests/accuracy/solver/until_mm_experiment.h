// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace rigcal::accuracy {

struct UntilOptions {
  int camera_count = 6;
  double duration_s = 120;  // at most
  double until_mm = 0.5;
  double lens_error =
      0;  // of the described lenses: 1 is 0.2 % of the focal length, 2 px of the centre
  bool guided = false;  // the person goes where told; else anywhere
  bool stop = false;    // end the trial at the target
};

// The running estimate at one time of the wave.
struct UntilStep {
  double time_s = 0;
  int poorest_views = 0;    // wand views of the camera that has fewest
  double predicted_mm = 0;  // ExpectedError::p95_m; 0: no estimate of all cameras
  double true_mm = 0;       // so large is the error in 95 % of the points
  bool agrees = false;      // the held-out check
  double solve_s = 0;       // CPU time of the estimate
};

struct UntilTrial {
  absl::Status status;
  std::vector<UntilStep> steps;

  // Index of the first step at which a session would end; -1: none.
  int StopAt(double until_mm) const;
  // Of the first step at which the poorest camera has so many views.
  int StepWithViews(int views) const;
};

// A rig of free-running clocks (one camera 8 ms off), lenses that are described a little wrong, and
// a person who waves for two seconds at a time.
UntilTrial RunUntilTrial(const UntilOptions& options, uint32_t seed);

}  // namespace rigcal::accuracy
