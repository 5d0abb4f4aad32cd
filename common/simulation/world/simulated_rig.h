// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/simulation/world/simulated_world.h"
#include "common/simulation/world/simulation_options.h"
#include "common/simulation/world/wand_trajectory.h"

namespace rigcal {

// Cameras on one ring of up to ten, or on several rings one above the other, all looking to the
// middle; neighbours are 3 to 5 m apart. Fewer than six stand on a part of the ring. `options` must
// be valid.
std::vector<SimulatedCamera> MakeSimulatedCameras(const SimulationOptions& options);

// The volume that these cameras look at.
WaveVolume MakeWaveVolume(const SimulationOptions& options);

}  // namespace rigcal
