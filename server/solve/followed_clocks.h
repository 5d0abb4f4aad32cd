// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/solve/solve_and_report.h"

namespace rigcal::server {

// Follows clocks that jumped or drifted, one after the other, where they are for the solve to
// find, as long as held-out data say that they fit better so. What was followed is appended to
// `followed`. CANCELLED.
absl::Status FollowClocks(const std::vector<ClockCorrection>& clocks,
                          const CalibrationOptions& options, const CalibrationHooks& hooks,
                          const std::map<std::string, CameraCounts>& counts,
                          const RefusalCounter& refused, const std::shared_ptr<const HeldRig>& held,
                          RigObservations* rig, Solved* solved, std::vector<Finding>* followed);

}  // namespace rigcal::server
