// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/calibration_options.h"
#include "server/solve/calibrate.h"

namespace rigcal::server {

// The parent in the frame, or with the scale, that the options ask for (SolveKind::kOrigin,
// kScale): from rows of the one session of the input, or from what the options themselves bring.
// Rows of cameras that the parent does not have are left out, and counted.
//
// Where the clocks are those of the parent, rows are brought to one time by its offsets. After a
// restart they are not: then times are as good as the agents align them, which is enough for what
// rests, and rows of what moves are refused.
// FAILED_PRECONDITION: the parent is missing; there are no rows; sources of the scale disagree;
// what common/origin and common/scale refuse. INVALID_ARGUMENT: a camera that the parent does not
// have.
absl::StatusOr<CalibrationResult> DeriveFrame(CalibrationInput* input,
                                              const CalibrationOptions& options,
                                              RefusalCounter* refused);

}  // namespace rigcal::server
