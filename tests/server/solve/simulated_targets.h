// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <vector>

#include "common/simulation/world/simulated_world.h"
#include "common/target/target.h"

namespace rigcal::server {

// Markers at 0, 0.13 and 0.39 m.
Target WandTarget();
Target PointTarget();
// Rigid: nine by six points, 40 mm apart; and twelve points in space within 0.3 m. One sigma of
// each coordinate.
Target PlaneTarget(double sigma_m);
Target BodyTarget(double sigma_m);
// Static points of unknown position.
Target StaticTarget(int count);

// A rig with this target, from the text of simulation options, which must be right.
SimulatedWorld WorldOf(std::string_view simulation, const Target& target);
// The same rig with each target.
std::vector<SimulatedWorld> WorldsOf(std::string_view simulation,
                                     const std::vector<Target>& targets);

}  // namespace rigcal::server
