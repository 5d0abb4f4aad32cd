// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/calibration_options.h"
#include "server/solve/diagnose/findings.h"
#include "server/solve/evaluate/evaluated_solve.h"

namespace rigcal::server {

// Counts of one camera over all sessions.
struct CameraCounts {
  uint32_t observation_count = 0;
  uint32_t wand_count = 0;
};

struct ReportInput {
  const RigObservations& rig;
  const EvaluatedSolution& evaluated;
  const CalibrationOptions& options;
  const std::map<std::string, CameraCounts>& counts;  // by camera
};

// Turns a solution into a calibration: poses, clocks against the median clock, residuals, length
// errors, digest. A camera with clocks in several sessions reports the one of the session with the
// lowest id. Adds to `refused` what the solve left out: `alone_in_instant` (wand views nobody else
// shares), `not_nearest_in_instant` (freely running cameras), `instant_without_pose`,
// `labels_flipped`, `outlier` (markers). FAILED_PRECONDITION where a camera has no pose that
// can be vouched for. `courses`: clocks that jumped or drifted, not followed by the solution.
absl::StatusOr<CalibrationResult> ReportCalibration(const ReportInput& input,
                                                    RefusalCounter* refused,
                                                    std::vector<FoundCourse>* courses);

}  // namespace rigcal::server
