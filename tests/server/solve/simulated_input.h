// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/simulation/world/simulated_world.h"
#include "server/solve/calibrate.h"
#include "server/solve/rig/rig_observations.h"
#include "tests/server/solve/simulated_targets.h"

namespace rigcal::server {

// The observations of a simulated world as agents deliver them; row i of a camera is its frame i.
// `outliers[camera][frame][marker]`, if given, is the ground truth.
CalibrationInput InputOf(const SimulatedWorld& world,
                         std::vector<std::vector<std::vector<bool>>>* outliers = nullptr);

// Sessions `s0`, `s1`, ... of one rig that was simulated with several targets: of each world an
// equal share of the frames, one after the other, so that no frame's noise is in two sessions.
CalibrationInput MixedInputOf(const std::vector<SimulatedWorld>& worlds);

// The input as the solver sees it: cleaned, clocks aligned, indexed. `clocks`: without corrections.
RigObservations RigOf(const CalibrationInput& input, std::vector<ClockCorrection>* clocks);

struct PoseErrors {
  double worst_position_m = 0;
  double rms_position_m = 0;
  double worst_rotation_rad = 0;
};

// Against ground truth after the rigid alignment that fits the camera centres best (with two
// cameras, whose baseline leaves a rotation open, the one that fits the orientations best).
PoseErrors ComparePoses(const CalibrationResult& result, const SimulatedWorld& world);

}  // namespace rigcal::server
