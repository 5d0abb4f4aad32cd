// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/solve/diagnose/clock_course.h"

namespace rigcal::server {

// Writes into `course` the model that explains the blocks best: its kind, coefficients, steps
// (their times to a block) or corners, size and sigma (which includes the blocks' scatter). Nothing
// where a constant explains them (see MeasureClockCourse).
//
// Models with as many breaks (steps or corners) are compared by the Bayesian information criterion
// (Schwarz 1978), with the blocks' scatter about the best one as their sigma where it is larger.
// One with more breaks must in addition take away most of the scatter that the one with fewer
// leaves.
void ChooseCourseModel(const std::vector<CourseBlock>& blocks, ClockCourse* course);

}  // namespace rigcal::server
