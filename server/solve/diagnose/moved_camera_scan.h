// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "server/solve/diagnose/trial_solve.h"

namespace rigcal::server {

// Step of a camera's pose as in ReducedParameter: rotation vector in the camera's frame from the
// left, then what is added to the translation.
using PoseStep = Eigen::Matrix<double, 6, 1>;

struct ChangePoint {
  int64_t rig_time_ns = 0;  // before the first instant of the second part
  PoseStep before = PoseStep::Zero();
  PoseStep after = PoseStep::Zero();
  // Share of the camera's residuals (sum of norms, each at most 60 px) that two poses instead of
  // one take away, the target's poses as they are.
  double gain = 0;
};

// The time at which a camera's residuals are best explained by its having moved: two pose steps,
// each linear and by least absolute errors, over a scan of times. Outliers take part, a camera that
// has moved far being nothing but outliers. None with too few markers.
std::optional<ChangePoint> ScanForMove(const TrialProblem& trial, int camera);

}  // namespace rigcal::server
