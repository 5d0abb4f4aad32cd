// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "common/simulation/world/simulated_world.h"

namespace rigcal::accuracy {

struct OriginTrial {
  absl::Status status;
  // Of the floor as the calibration in its new frame has it, over 4 m: its tilt, and the largest
  // height of a point of the true floor.
  double tilt_deg = 0, height_m = 0;
  double stated_tilt_deg = 0;  // one sigma, of both axes together
  double nees = 0;             // of the transform from the reference camera's frame: 6 degrees
  int place_count = 0;
};

// Calibrates a simulated rig, lays its wand on the floor at `places` places, 4 m from the cameras,
// and makes the floor z = 0.
OriginTrial RunOriginTrial(const SimulationOptions& simulation, int places);

}  // namespace rigcal::accuracy
