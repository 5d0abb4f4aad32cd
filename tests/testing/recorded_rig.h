// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "common/simulation/world/simulation_options.h"

namespace rigcal::testing {

// Writes a simulated rig as a recorded one: <camera>.yaml and <camera>.csv for each camera.
void WriteRecordedRig(const SimulationOptions& options, const std::filesystem::path& directory);

}  // namespace rigcal::testing
