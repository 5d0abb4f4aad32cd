// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/rig_solver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::rig_solver_test {
namespace {

using ::rigcal::testing::IsOk;

struct Simulated {
  RigObservations rig;
  std::vector<ClockCorrection> clocks;
};

Simulated Simulate(const std::string& text) {
  const auto options = ::rigcal::testing::ParseSimulationOptions(text);
  EXPECT_THAT(options, IsOk());
  const auto world = SimulatedWorld::Create(*options, WandTarget());
  EXPECT_THAT(world, IsOk());
  Simulated simulated;
  simulated.rig = RigOf(InputOf(*world), &simulated.clocks);
  return simulated;
}

RigSolveOptions Everything() {
  RigSolveOptions options;
  options.refine_intrinsics = true;
  options.estimate_marker_positions = true;
  return options;
}

// A camera's centre relative to another's, which knows no scale but the solution's.
double BaselineM(const RigSolution& solution) {
  return (solution.built.problem.cameras.front().cam_from_rig.SourceFromTargetTranslation() -
          solution.built.problem.cameras.back().cam_from_rig.SourceFromTargetTranslation())
      .norm();
}

// The images say nothing about the scale, so that steps towards it end too early.
TEST(SolveRig, TheScaleOfALargeRigHasConverged) {
  const Simulated simulated =
      Simulate("cameras=16;duration=20;focal_sigma=0.003;length_error=0.002");
  const auto solved = SolveRig(simulated.rig, simulated.clocks, Everything());
  ASSERT_THAT(solved, IsOk());
  EXPECT_TRUE(solved->converged);
  const RigInitialization initial = InitializationFrom(*solved);
  const auto again = SolveRig(simulated.rig, initial.clocks, Everything(), &initial);
  ASSERT_THAT(again, IsOk());
  const double length_m = solved->built.problem.target.marker_positions_m.back();
  EXPECT_NEAR(again->built.problem.target.marker_positions_m.back() / length_m, 1, 1e-6);
  EXPECT_NEAR(BaselineM(*again) / BaselineM(*solved), 1, 1e-5);
}

// Everything but the reference's clock agrees: the others have to follow it together.
TEST(SolveRig, ManyClocksFollowTheReferences) {
  const Simulated simulated = Simulate("cameras=30;duration=6;offset.0=0.02");
  RigSolveOptions options;
  const auto solved = SolveRig(simulated.rig, simulated.clocks, options);
  ASSERT_THAT(solved, IsOk());
  EXPECT_TRUE(solved->converged);
  const std::vector<ClockCorrection> clocks = InitializationFrom(*solved).clocks;
  EXPECT_EQ(clocks[0].time_offset_s, simulated.clocks[0].time_offset_s);
  for (size_t k = 1; k < clocks.size(); ++k) {
    EXPECT_NEAR(std::abs(clocks[k].time_offset_s), 0.02, 1e-3) << k;
  }
}

TEST(SolveRig, ARoughSolveOfAPartIsNearTheWhole) {
  const Simulated simulated = Simulate("cameras=6;duration=60;offset.2=0.006");
  const auto whole = SolveRig(simulated.rig, simulated.clocks, Everything());
  ASSERT_THAT(whole, IsOk());
  const RigInitialization initial = InitializationFrom(*whole);
  RigSolveOptions options = Everything();
  options.rough = true;
  options.max_observations = 3000;
  const auto part = SolveRig(simulated.rig, initial.clocks, options, &initial);
  ASSERT_THAT(part, IsOk());
  EXPECT_GT(part->built.problem.observations.size(), 2000u);
  EXPECT_LT(part->built.problem.observations.size(), 4000u);
  EXPECT_NEAR(BaselineM(*part) / BaselineM(*whole), 1, 2e-3);
  int unused = 0;
  for (const BundleMarker& marker : part->built.problem.markers) unused += marker.used ? 0 : 1;
  // The simulation's outliers, two in a hundred.
  EXPECT_GT(unused, static_cast<int>(part->built.problem.markers.size()) / 100);
}

}  // namespace
}  // namespace rigcal::server::rig_solver_test
