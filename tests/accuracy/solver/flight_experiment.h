// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/calibration_options.h"
#include "tests/accuracy/solver/path_comparison.h"
#include "tests/server/solve/simulated_flight.h"

namespace rigcal::accuracy {

struct FlightRun {
  CalibrationResult result;
  std::vector<TimedPosition> path;  // of the drone, in the unit of the result; by time
  PathErrors errors;                // against its path by RTK
  double cpu_s = 0;                 // of the calibration
};

// Calibrates the recording `flight` in the folder of recordings: four consumer cameras that were
// started by hand, and one point. Errors of reading, of Calibrate() and of ComparePaths().
absl::StatusOr<FlightRun> RunFlight(const std::filesystem::path& data,
                                    const CalibrationOptions& options);
// Calibrates a simulated one. Errors of Calibrate() and of ComparePaths().
absl::StatusOr<FlightRun> RunSimulatedFlight(const server::SimulatedFlight& flight,
                                             const CalibrationOptions& options);

}  // namespace rigcal::accuracy
