// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "server/solve/diagnose/session_timeline.h"
#include "server/solve/diagnose/trial_solve.h"

namespace rigcal::server {

// Step of a camera's pose as in ReducedParameter: rotation vector in the camera's frame from the
// left, then what is added to the translation.
using PoseStep = Eigen::Matrix<double, 6, 1>;

// What a camera's residuals say of its having moved once, or there and back, the target's poses
// being as they are.
struct ChangePoint {
  int64_t time_ns = 0;  // of the timeline, before the first instant of the second part
  // Before the first instant at which it is back where it was.
  int64_t until_ns = std::numeric_limits<int64_t>::max();
  PoseStep before = PoseStep::Zero();
  PoseStep after = PoseStep::Zero();
  // Share of the camera's residuals (sum of norms, each at most 60 px) that two poses instead of
  // one take away, the target's poses as they are.
  double gain = 0;

  bool IsBack() const { return until_ns < std::numeric_limits<int64_t>::max(); }
  bool HasMoved(int64_t at_ns) const { return at_ns >= time_ns && at_ns < until_ns; }
};

// A marker of a placed instant as one camera sees it.
struct MoveSample {
  int64_t time_ns = 0;                                 // of the timeline
  size_t marker = 0;                                   // of the problem
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  // predicted minus measured, pixels
  // Of the residual by the camera's pose step.
  Eigen::Matrix<double, 2, 6> jacobian = Eigen::Matrix<double, 2, 6>::Zero();
  Eigen::Vector2d from_principal_px = Eigen::Vector2d::Zero();  // of where it was predicted
};

// Beyond this a residual counts no more.
inline constexpr double kMoveCapPx = 60;

// Of one camera, ascending by time: all of them, and about 1500.
std::vector<MoveSample> AllMoveSamplesOf(const TrialProblem& trial, const SessionTimeline& timeline,
                                         int camera);
std::vector<MoveSample> MoveSamplesOf(const TrialProblem& trial, const SessionTimeline& timeline,
                                      int camera);

// Share of the residuals that two poses must take away to be worth a look.
inline constexpr double kMinScanGain = 0.05;

// The time at which a camera's residuals are best explained by its having moved: two pose steps,
// each linear and by least absolute errors, over a scan of times. Where one of them for a span of
// time in the middle explains clearly more, it moved there and back. Outliers take part, a camera
// that has moved far being nothing but outliers. None with too few markers.
std::optional<ChangePoint> ScanForMove(const TrialProblem& trial, const SessionTimeline& timeline,
                                       int camera);

// Do two poses, before and after the change, also fit what they were not fitted to? Each part is
// cut into blocks of time, every other one is held out of the fits, in turns. Errors that
// neighbouring times have in common can be fitted by a pose that a few seconds say little about: it
// does not fit the next few.
bool HoldsForOtherTimes(const TrialProblem& trial, const SessionTimeline& timeline, int camera,
                        const ChangePoint& change);

// Mean error with one pose, of the part in which it has moved or of the rest: the larger. Pixels.
double LargestErrorPx(const TrialProblem& trial, const SessionTimeline& timeline, int camera,
                      const ChangePoint& change);

}  // namespace rigcal::server
