// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/calibration/calibration.h"
#include "common/status/refusal.h"
#include "server/solve/calibration_report.h"
#include "server/solve/evaluate/evaluated_solve.h"
#include "server/solve/rig/rig_observations.h"

namespace rigcal::server {

// The expected error of a point and what makes it up: the error that 95 % of the places where the
// wand was, and one step around them, stay below (ExpectedError::p95_m), as a running estimate has
// it. Metres.
struct PointError {
  double by_covariance_m = 0;  // as if kept intrinsics were exact
  double with_lenses_m = 0;    // and what these are off (kept_lenses.h)
  double fold_factor = 1;      // PredictedError::fold_factor
  // What ExpectedError::p95_bound_m is of p95_m.
  double bound_factor = 1;

  double StatedM() const;
  double BoundM() const { return bound_factor * StatedM(); }
  ErrorBasis Basis() const;  // what makes most of it
};

// None where no uncertainty is known, the scale is not, or the target is not a wand.
std::optional<PointError> MeasurePointError(const RigObservations& rig,
                                            const EvaluatedSolution& evaluated);

// The figures beside the grade.
Headline MakeHeadline(const RigObservations& rig, const EvaluatedSolution& evaluated,
                      const std::map<std::string, CameraCounts>& counts,
                      const std::vector<Refusal>& refused, const CalibrationResult& result);

}  // namespace rigcal::server
