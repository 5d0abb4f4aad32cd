// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/calibration_options.h"

namespace rigcal::server {

// A new solve in the frame of an earlier calibration: aligned over the cameras that did not move
// (CompareRigs), by generalised least squares with the joint covariances of both. With d the
// differences of those poses, C their covariance and F how they follow the frame, a wide prior V of
// the frame gives
//   f = -K d,  K = V F^T (C + F V F^T)^-1.
// What the frame owes to the new solve's poses stays correlated with them; what it owes to the
// earlier ones is its own error. Where the poses scatter more than they should, chi-square per
// degree of freedom is taken into that. FAILED_PRECONDITION: fewer than two cameras stayed, or
// which ones cannot be told; errors of CompareRigs.
absl::StatusOr<CalibrationResult> KeepFrame(const CalibrationResult& earlier,
                                            const std::string& earlier_id,
                                            const CalibrationResult& now);

// The report of a frame that a derived calibration has from its parent; none where that has the
// frame of its reference camera.
std::optional<CalibrationFrame> InheritedFrame(const CalibrationResult& parent,
                                               const std::string& parent_id);

}  // namespace rigcal::server
