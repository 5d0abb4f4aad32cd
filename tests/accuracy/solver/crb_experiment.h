// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/target/target.h"
#include "tests/accuracy/rig/statistics.h"

namespace rigcal::accuracy {

// A target of the experiments, its points exact: `wand` (0, 0.13, 0.39 m), `long` (a wand of 0,
// 0.21, 0.33, 0.6 m), `body` (the twelve
// corners of an icosahedron of 0.25 m), `plane` (nine by six points, 40 mm apart), `square` (its
// four corners); `room` (40 static points of unknown position), `survey` (twelve static points of
// known position).
Target NamedTarget(const std::string& name);

// Camera positions against their Cramer-Rao bound when only poses are estimated: spacing exactly
// nominal and fixed, intrinsics and clocks right and fixed.
struct CrbOptions {
  int camera_count = 6;
  double duration_s = 40;  // at 25 instants per second
  double noise_px = 0.3;
  double outlier_share = 0;
  double dropout_share = 0.05;
  Target target = NamedTarget("wand");
  // Sessions with other targets, of the same rig: each has an equal share of the duration.
  std::vector<Target> mixed_with;
};

// The named targets, several joined by +, one session for each.
void SetTargets(const std::string& names, CrbOptions* options);

struct CrbTrial {
  absl::Status status;
  // Sums over all cameras except the reference: |error|^2 of the position, and its bound.
  double squared_error_m2 = 0;
  double bound_m2 = 0;
  double largest_ratio = 0;  // of one camera: |error| / sqrt(trace of its bound)
  Nees position_nees;        // of all positions together, against the bound

  double Ratio() const;
};

// One simulated rig, trajectory and noise.
CrbTrial RunCrbTrial(const CrbOptions& options, uint32_t seed);

struct CrbSummary {
  int failures = 0;
  double ratio = 0;  // RMSE over all cameras and seeds / root mean bound
  double largest_trial_ratio = 0;
  double largest_camera_ratio = 0;
  NeesSum position_nees;
};
CrbSummary Summarise(const std::vector<CrbTrial>& trials);

}  // namespace rigcal::accuracy
