// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/simulation/world/simulation_options.h"
#include "tests/accuracy/rig/marker_fates.h"

namespace rigcal::accuracy {

// A way in which a recording is bad; the first one is clean, and the last is all of them together.
struct RobustnessCase {
  std::string name;
  SimulationOptions simulation;
};
// 30 % gross outliers in one camera, 5 % reversed labels, 40 % dropouts, 10 s without any camera
// seeing the wand.
std::vector<RobustnessCase> RobustnessCases(int camera_count, double duration_s);

struct RobustnessTrial {
  absl::Status status;
  double position_rms_m = 0;
  // What any solver could reach that is told labels and outliers and estimates poses alone.
  double bound_rms_m = 0;
  std::optional<FateCounts> fates;  // none: the solver does not show them
};

// All defaults, as a user would calibrate.
RobustnessTrial RunRobustnessTrial(const RobustnessCase& entry, uint32_t seed);

// Root mean square position error over the trials, by that of the clean ones; where both
// succeeded.
double RatioOfRms(const std::vector<RobustnessTrial>& trials,
                  const std::vector<RobustnessTrial>& clean);

}  // namespace rigcal::accuracy
