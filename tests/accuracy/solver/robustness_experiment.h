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

// A kind of bad recording; the first one is clean, the last combines all of them.
struct RobustnessCase {
  std::string name;
  SimulationOptions simulation;
};
// 30 % gross outliers in one camera, 5 % flipped labels, 40 % dropouts, 10 s without any camera
// seeing the wand.
std::vector<RobustnessCase> RobustnessCases(int camera_count, double duration_s);

struct RobustnessTrial {
  absl::Status status;
  double position_rms_m = 0;
  // The bound of a solver that knows labels and outliers and estimates only poses.
  double bound_rms_m = 0;
  std::optional<FateCounts> fates;
};

// Calibrates with all defaults.
RobustnessTrial RunRobustnessTrial(const RobustnessCase& entry, uint32_t seed);

// Root mean square position error over that of the clean trials, of seeds where both succeeded.
double RatioOfRms(const std::vector<RobustnessTrial>& trials,
                  const std::vector<RobustnessTrial>& clean);

}  // namespace rigcal::accuracy
