// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

#include "common/calibration/calibration.h"
#include "common/status/refusal.h"
#include "server/solve/calibration_report.h"
#include "server/solve/evaluate/evaluated_solve.h"
#include "server/solve/evaluate/predicted_error.h"
#include "server/solve/rig/rig_observations.h"

namespace rigcal::server {

// By how much larger errors are than the covariance says, because parts of the data, or other
// intrinsics that fit as well, put the cameras elsewhere; at least 1.
double UnstatedFactor(const PredictedError& predicted);

// The figures beside the grade. The error of a point is that of a running estimate
// (running/expected_error.h), at the places where the wand was and one step around them,
// times UnstatedFactor.
Headline MakeHeadline(const RigObservations& rig, const EvaluatedSolution& evaluated,
                      const std::map<std::string, CameraCounts>& counts,
                      const std::vector<Refusal>& refused, const CalibrationResult& result);

}  // namespace rigcal::server
