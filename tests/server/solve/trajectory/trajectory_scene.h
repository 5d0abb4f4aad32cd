// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

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
  bool free_spacing = false;
  std::vector<double> marker_positions_m = {0, 0.13, 0.39};  // as given
  double span_sigma_m = 0.002;                               // of the prior, if free
  bool draw_spans = false;  // the true spans are other ones, by the prior
  double focal_px = 800;
  double initial_scale = 1;  // of all lengths, about the first camera
  double initial_error = 1;  // 1: cameras 5 mm and 5 mrad off, clocks 1 ms, the path 2 cm
};

// Free-running cameras with rolling shutters in a ring around a target whose path is a spline.
// The rig frame is the first camera's. Estimated are poses, offsets and line delays; of a point,
// with the distance of two cameras given.
struct TrajectoryScene {
  TrajectoryProblem initial, ground_truth;
};
TrajectoryScene MakeTrajectoryScene(const TrajectorySceneOptions& options);

}  // namespace rigcal::server
