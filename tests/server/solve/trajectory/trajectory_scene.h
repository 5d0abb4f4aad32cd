// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "server/solve/trajectory/trajectory_problem.h"

namespace rigcal::server {

struct TrajectorySceneOptions {
  uint32_t seed = 1;
  int camera_count = 4;
  double rate_hz = 12;  // of each camera, at a phase of its own
  double duration_s = 8;
  double step_s = 0.04;    // of the true path's knots
  double noise_px = 0;     // of the centres
  double stated_px = 0.3;  // as which they are stated
  double kept_share = 1;   // of the rows, at random
  double line_delay_s = 20e-6;
  bool is_point = false;
  bool free_spacing = false;  // under a prior of 2 mm
  double initial_error = 1;   // 1: cameras 5 mm and 5 mrad off, clocks 1 ms, the path 2 cm
};

// Free-running cameras with rolling shutters in a ring around a target whose path is a spline.
// The rig frame is the first camera's. Estimated are poses, offsets and line delays; of a point,
// with the distance of two cameras given.
struct TrajectoryScene {
  TrajectoryProblem initial, ground_truth;
};
TrajectoryScene MakeTrajectoryScene(const TrajectorySceneOptions& options);

}  // namespace rigcal::server
