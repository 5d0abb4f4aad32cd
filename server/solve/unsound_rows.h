// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/status/refusal.h"
#include "server/associate/static_points.h"
#include "server/solve/calibrate.h"
#include "server/solve/input_checks.h"

namespace rigcal::server {

struct UnsoundRows {
  std::vector<Finding> findings;   // rows_copied, rows_frozen
  std::set<std::string> left_out;  // cameras whose few other rows were taken away, too
};

// Takes away what no solve can use: rows that are another camera's, and rows of an image that is
// frozen. Of a camera that has hardly any others all rows are taken away. FAILED_PRECONDITION with
// the cause: fewer than two cameras are left, or one that the options name is not.
absl::StatusOr<UnsoundRows> TakeUnsoundRows(const CalibrationOptions& options,
                                            const TargetOfSession& target_of,
                                            CalibrationInput* input, RefusalCounter* refused);

}  // namespace rigcal::server
