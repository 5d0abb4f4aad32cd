// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/solve/solve_and_report.h"

namespace rigcal::server {

// Rows of cameras that fit otherwise, in which the markers are not those of the target.
struct BadRows {
  std::vector<std::vector<size_t>> rows;  // by track of the rig, ascending
  std::vector<Finding> findings;          // outliers_in_camera, second_wand_seen
};

// A camera's row is bad where two other cameras at least have placed the target and none of its
// markers fits by far. A camera is named where a tenth of its rows are, by chance among those that
// fit, and throughout the recording: what moved, or a clock that jumped, is bad from some time on.
// Where bad rows of two cameras show one target of the right lengths somewhere else, that is a
// second wand.
BadRows FindBadRows(const RigObservations& rig, const RigSolution& solution);

struct LeftOutRows {
  std::map<std::string, uint32_t> markers;  // visible ones of these rows, by camera
  std::vector<Finding> findings;
};

// Solves again without the bad rows of a solution, if there are any: its parts and what is held out
// are then those of the target. Kept where it can be solved. CANCELLED.
absl::Status LeaveOutBadRows(const std::vector<ClockCorrection>& clocks,
                             const CalibrationOptions& options, const CalibrationHooks& hooks,
                             const std::map<std::string, CameraCounts>& counts,
                             const std::shared_ptr<const HeldRig>& held, RefusalCounter* refused,
                             RigObservations* rig, Solved* solved, LeftOutRows* left_out);

// Adds their markers to the outliers of the cameras.
void CountAsOutliers(const LeftOutRows& left_out, CalibrationResult* result);

}  // namespace rigcal::server
