// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/solve/calibrate.h"
#include "server/solve/calibration_report.h"
#include "server/solve/evaluate/evaluated_solve.h"
#include "server/solve/input_checks.h"
#include "server/solve/rig/held_rig.h"

namespace rigcal::server {

// Index of a camera of the rig; 0 for none.
int CameraIndex(const RigIndex& index, const std::string& name);

// The options ask for a camera's intrinsics to stay as given.
bool KeepsIntrinsics(const CalibrationOptions& options, const std::string& camera);

// Of the whole calibration, for one solve. `held`: cameras that stay where they are (a repair).
RigSolveOptions SolveOptionsOf(const RigObservations& rig, const CalibrationOptions& options,
                               const CalibrationHooks& hooks,
                               const std::map<std::string, CameraCounts>& counts,
                               std::shared_ptr<const HeldRig> held = nullptr);

// A calibration before it is published.
struct Solved {
  EvaluatedSolution evaluated;
  CalibrationResult result;
  RefusalCounter refused;            // what was left out by it, and before
  std::vector<FoundCourse> courses;  // of clocks, that it does not follow
};

// Searches the clocks where they are not known, solves, judges and reports. FAILED_PRECONDITION: it
// cannot be solved; CANCELLED.
absl::StatusOr<Solved> SolveAndReport(const RigObservations& rig,
                                      const std::vector<ClockCorrection>& clocks,
                                      const RigSolveOptions& solve,
                                      const CalibrationOptions& options,
                                      const std::map<std::string, CameraCounts>& counts,
                                      const RefusalCounter& refused);

}  // namespace rigcal::server
