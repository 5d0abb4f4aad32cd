// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>
#include <string>
#include <vector>

#include "common/calibration/calibration.h"
#include "common/time/clock_course.h"
#include "server/solve/evaluate/evaluated_solve.h"

namespace rigcal::server {

// One cause of error with what it costs, by which causes are sorted.
struct Cause {
  Finding finding;
  double cost_px = 0;  // mean error of the camera (or of all) that goes away when it is removed
  // Seen by itself, whatever else is wrong: no mere candidate.
  bool certain = false;
};

// A clock that jumped or drifted, and what its course is.
struct FoundCourse {
  int clock = 0;         // of the index
  ClockCourseLine line;  // on top of what its rows have already
  // As the cause, its advice without what to do.
  Finding finding;
};

// What was found, worst first.
struct Causes {
  std::vector<Cause> causes;
  std::vector<FoundCourse> courses;
  // With every cause taken out these fit as the cameras of a usable calibration do. What is wrong
  // with another one is not known, and no figure about it holds; where half of the cameras do not
  // fit, none about any.
  std::set<std::string> fitting;
  size_t camera_count = 0;
};

// Names what is wrong with a rig or a recording from the pattern of the residuals, with numbers and
// where it can be computed the error that would be left. docs/findings.md lists the kinds and their
// thresholds. `result` holds the cameras and the target as reported.
//
// An explanation counts when its parameter is significant and it also takes away a part of the
// error that matters; a recording of many thousand markers makes everything significant. Worst
// first; what `evaluated` found comes last. Cancelled or failed trials give no finding.
Causes FindCauses(const RigObservations& rig, const EvaluatedSolution& evaluated,
                  const CalibrationResult& result);

// The findings of a result. `is_bad` by its figures: what is a cause of error of a camera that does
// not fit comes as a candidate, with what it would explain instead of its size.
std::vector<Finding> FindingsOf(const Causes& causes, bool is_bad);

}  // namespace rigcal::server
