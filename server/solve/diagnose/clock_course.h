// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/time/clock_course.h"
#include "server/solve/clocks/ray_paths.h"
#include "server/solve/diagnose/trial_solve.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"

namespace rigcal::server {

// What a clock was still off after the solve, in one block of time.
struct CourseBlock {
  double time_s = 0;    // of its middle, from the first instant
  double offset_s = 0;  // to be added to its time offset
  double sigma_s = 0;   // one sigma
  double error_px = 0;  // median, at that offset
};

enum class CourseKind : uint8_t { kConstant, kSteps, kSlope, kCurve, kCorners };

struct ClockStep {
  double time_s = 0;  // from the first instant
  double size_s = 0;  // with its sign
  double sigma_s = 0;
};

// Where a clock's rate changed.
struct ClockCorner {
  double time_s = 0;  // from the first instant
  double slope = 0;   // from then on added to the slope, s/s
};

// How a clock ran over the recording, as far as a constant offset and the estimated rate do not
// describe it: the simplest model that explains the blocks.
struct ClockCourse {
  int track = -1;                   // that was measured
  std::vector<CourseBlock> blocks;  // ascending by time
  CourseKind kind = CourseKind::kConstant;
  // offset = sum of coefficients[i] * (time_s - middle_s)^i, and from each step and corner on what
  // it adds.
  std::vector<double> coefficients;
  double middle_s = 0;
  std::vector<ClockStep> steps;      // of kSteps, ascending by time
  std::vector<ClockCorner> corners;  // of kCorners, ascending by time
  double size_s = 0;   // of the largest step, with its sign; of a drift, from least to largest
  double sigma_s = 0;  // of it, one sigma
  // Mean error over the camera's markers (at most 30 px each) with one offset, and with this
  // course.
  double before_px = 0, after_px = 0;
  TrackPaths paths;      // of the track, at the rig times of the trial
  ClockCourseLine line;  // the same by the camera's clock; 0 at the first row

  double gain_px() const { return before_px - after_px; }
  double OffsetAt(double time_s) const;
};

// Measures the clock against the markers that the cameras of the other clocks triangulate: in each
// of up to 20 blocks of time the offset at which the camera's own path fits best, with its pose
// fitted again to all blocks; near the estimated offset, and where that does not fit within 0.6 s.
// Compares a constant, a straight line, a parabola, up to three steps, alone or on a straight line
// (what a rate leaves that was estimated over a step), and up to three corners (see
// ChooseCourseModel).
//
// None where fewer than 6 blocks can be measured: too little data, or fewer than two cameras on
// other clocks. kConstant where nothing else is significant (5 sigma, 1.5 ms, and most of the
// scatter).
std::optional<ClockCourse> MeasureClockCourse(const RigObservations& rig,
                                              const RigSolution& solution,
                                              const TrialProblem& trial, int clock);

}  // namespace rigcal::server
