// SPDX-License-Identifier: Apache-2.0
#include "tests/server/solve/simulated_targets.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "tests/testing/simulation_text.h"

namespace rigcal::server {

Target WandTarget() {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  return target;
}

Target PointTarget() {
  Target target;
  target.kind = TargetKind::kPoint;
  target.marker_positions_m = {0};
  return target;
}

Target PlaneTarget(double sigma_m) {
  Target target;
  target.kind = TargetKind::kRigid;
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 9; ++column) {
      target.points.push_back(
          {absl::StrCat("p", row, ".", column), 0.04 * column, 0.04 * row, 0, sigma_m});
    }
  }
  return target;
}

Target BodyTarget(double sigma_m) {
  Target target;
  target.kind = TargetKind::kRigid;
  for (int i = 0; i < 12; ++i) {
    target.points.push_back({absl::StrCat("b", i), 0.15 * std::sin(2.1 * i),
                             0.15 * std::cos(1.3 * i), 0.025 * (i - 6), sigma_m});
  }
  return target;
}

Target StaticTarget(int count) {
  Target target;
  target.kind = TargetKind::kStatic;
  for (int i = 0; i < count; ++i) target.points.push_back({absl::StrCat("room", i), 0, 0, 0, 0});
  return target;
}

SimulatedWorld WorldOf(std::string_view simulation, const Target& target) {
  return *SimulatedWorld::Create(*testing::ParseSimulationOptions(simulation), target);
}

std::vector<SimulatedWorld> WorldsOf(std::string_view simulation,
                                     const std::vector<Target>& targets) {
  std::vector<SimulatedWorld> worlds;
  for (const Target& target : targets) worlds.push_back(WorldOf(simulation, target));
  return worlds;
}

}  // namespace rigcal::server
