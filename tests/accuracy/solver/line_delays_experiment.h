// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "common/calibration/calibration.h"
#include "common/calibration/calibration_options.h"
#include "tests/accuracy/rig/rig_covariance.h"
#include "tests/accuracy/solver/crb_experiment.h"

namespace rigcal::accuracy {

// Rolling shutters in every camera of a simulated rig, some of them read upwards. Spacing and
// intrinsics are right and fixed.
struct LineDelaysOptions {
  Target target = NamedTarget("wand");
  int camera_count = 6;
  double duration_s = 40;
  double rate_hz = 50;
  bool free_running = true;
  double largest_offset_s = 0.002;  // of a clock
  double speed_m_s = 1.5;           // of the wand, at most
  TrajectoryChoice trajectory = TrajectoryChoice::kAuto;
  double shortest_s = 5e-6, longest_s = 50e-6;  // line delays
};

struct LineDelaysTrial {
  absl::Status status;
  QualityGrade grade = QualityGrade::kNotEvaluated;
  double squared_error_m2 = 0, bound_m2 = 0;        // of the positions, scale included
  double delay_error_s2 = 0, delay_bound_s2 = 0;    // of the line delays
  double offset_error_s2 = 0, offset_bound_s2 = 0;  // of the offsets against the reference camera's
  double worst_offset_s = 0;                        // of them
  std::optional<RigNees> stated;                    // against the solver's covariance
  int camera_count = 0;
  int missed = 0;       // cameras without an estimated line delay
  bool spline = false;  // the target was followed through time
  double cpu_s = 0;
};

// The bound is that of poses, offsets and line delays together, of cameras whose frames of one
// number show one pose of the target.
LineDelaysTrial RunLineDelaysTrial(const LineDelaysOptions& options, uint32_t seed);

// Over the trials that did not fail.
struct LineDelaysSummary {
  int failed = 0, missed = 0, good = 0, splines = 0;
  double rmse_by_bound = 0, delay_by_bound = 0, offset_by_bound = 0;
  double delay_rms_s = 0;
  NeesSum shape, scale, offsets, delays;
};
LineDelaysSummary Summarise(const std::vector<LineDelaysTrial>& trials);

}  // namespace rigcal::accuracy
