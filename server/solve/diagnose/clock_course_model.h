// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/solve/diagnose/clock_course.h"

namespace rigcal::server {

// Writes into `course` the model that explains the blocks best, by the Bayesian information
// criterion: its kind, coefficients, size and sigma (which includes the blocks' scatter), and the
// time of a step to a block. Nothing where a constant explains them (see MeasureClockCourse).
void ChooseCourseModel(const std::vector<CourseBlock>& blocks, ClockCourse* course);

}  // namespace rigcal::server
