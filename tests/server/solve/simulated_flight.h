// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "common/geometry/rigid_transform.h"
#include "server/solve/calibrate.h"

namespace rigcal::server {

// Consumer cameras on the ground that nothing synchronises, and one point, a drone.
struct SimulatedFlightOptions {
  uint32_t seed = 1;
  int camera_count = 6;
  double duration_s = 200;
  double noise_px = 0.5;                         // one sigma of each coordinate; as stated
  double slowest_hz = 25, fastest_hz = 60;       // a camera's rate
  double shortest_s = 12e-6, longest_s = 36e-6;  // a camera's line delay; both 0: global shutters
  double largest_offset_s = 1;                   // of a clock
  double largest_rate_ppm = 50;                  // of a clock
  double focal_sigma_rel = 5e-4;                 // of the given lenses against the true ones
  double centre_sigma_px = 2;
};

struct SimulatedFlightCamera {
  double rate_hz = 0;
  double line_delay_s = 0;  // its rows take at most 0.95 of its period
  double time_offset_s = 0;
  RigidTransform cam_from_rig;  // frame `rig`: z up, metres
};

// The observations, and what is true of them.
struct SimulatedFlight {
  CalibrationInput input;
  std::vector<SimulatedFlightCamera> cameras;
  double path_hz = 0;
  std::vector<Eigen::Vector3d> path_m;  // of the point in `rig`, at even times from 0
};

// Images of 1920 x 1080 px; the point moves at some 4 m/s within 20 m, 40 to 60 m away. The same
// options give the same flight.
SimulatedFlight FlyPoint(const SimulatedFlightOptions& options);

}  // namespace rigcal::server
