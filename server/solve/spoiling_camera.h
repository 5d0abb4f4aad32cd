// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

#include "server/solve/diagnose/odd_camera.h"
#include "server/solve/solve_and_report.h"

namespace rigcal::server {

// The one camera that spoils a rig: it cannot be solved with it, or agrees with no pose of it.
OddCamera SpoilingCamera(const absl::StatusOr<Solved>& solved, const RigObservations& rig,
                         const std::vector<ClockCorrection>& clocks, const RigSolveOptions& solve);

// Named by the options, it cannot be left out.
bool IsNeeded(const std::string& camera, const CalibrationOptions& options);

// The rig without the camera that spoils it. An error: that is not to be solved either.
absl::StatusOr<Solved> SolveWithout(const OddCamera& odd, RigObservations* rig,
                                    const std::vector<ClockCorrection>& clocks,
                                    const CalibrationOptions& options,
                                    const CalibrationHooks& hooks,
                                    const std::map<std::string, CameraCounts>& counts,
                                    RefusalCounter refused);

}  // namespace rigcal::server
