// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/put_away.h"

#include <gtest/gtest.h>

#include <string>

#include "server/solve/rig/rig_solver.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::put_away_test {
namespace {

using ::rigcal::testing::IsOk;

// With flipped labels, outliers, clocks that are off, and (with a diameter) centres that move.
class PutAway : public ::testing::TestWithParam<double> {};

TEST_P(PutAway, TakeBackGivesTheSameBits) {
  const auto options = ::rigcal::testing::ParseSimulationOptions(
      "cameras=4;duration=20;swaps=0.05;outliers=0.05;offset.1=0.004;free_running=1");
  ASSERT_THAT(options, IsOk());
  Target target = WandTarget();
  target.diameter_m = GetParam();
  const auto world = SimulatedWorld::Create(*options, target);
  ASSERT_THAT(world, IsOk());
  CalibrationInput input = InputOf(*world);
  for (CameraTrack& track : input.tracks) {
    for (Observation& row : track.observations) {
      for (MarkerObservation& marker : row.markers) marker.centre_kind = CentreKind::kImageBlob;
    }
  }
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(input, &clocks);
  const RigSolveOptions solve;
  const auto solved = SolveRig(rig, clocks, solve);
  ASSERT_THAT(solved, IsOk());

  RigSolution solution = *solved;
  server::PutAway(rig, solve, &solution);
  EXPECT_EQ(solution.built.problem.markers.capacity(), 0u);
  EXPECT_EQ(solution.built.problem.observations.capacity(), 0u);
  EXPECT_EQ(solution.built.sources.capacity(), 0u);
  server::PutAway(rig, solve, &solution);  // nothing more to do
  TakeBack(rig, solve, &solution);
  TakeBack(rig, solve, &solution);

  const BundleProblem &before = solved->built.problem, &after = solution.built.problem;
  ASSERT_EQ(after.markers.size(), before.markers.size());
  int unused = 0;
  for (size_t m = 0; m < before.markers.size(); ++m) {
    ASSERT_EQ(after.markers[m].marker, before.markers[m].marker) << m;
    ASSERT_EQ(after.markers[m].used, before.markers[m].used) << m;
    ASSERT_EQ(after.markers[m].centre_px, before.markers[m].centre_px) << m;
    ASSERT_EQ(after.markers[m].velocity_px_s, before.markers[m].velocity_px_s) << m;
    ASSERT_EQ(after.markers[m].sqrt_information, before.markers[m].sqrt_information) << m;
    ASSERT_EQ(solution.built.sources[m].track, solved->built.sources[m].track);
    ASSERT_EQ(solution.built.sources[m].observation, solved->built.sources[m].observation);
    ASSERT_EQ(solution.built.sources[m].noise_share, solved->built.sources[m].noise_share);
    unused += before.markers[m].used ? 0 : 1;
  }
  EXPECT_GT(unused, 10);
  ASSERT_EQ(after.observations.size(), before.observations.size());
  for (size_t o = 0; o < before.observations.size(); ++o) {
    EXPECT_EQ(after.observations[o].camera, before.observations[o].camera);
    EXPECT_EQ(after.observations[o].clock, before.observations[o].clock);
    EXPECT_EQ(after.observations[o].clock_time_s, before.observations[o].clock_time_s);
    EXPECT_EQ(after.observations[o].first_marker, before.observations[o].first_marker);
    EXPECT_EQ(after.observations[o].marker_count, before.observations[o].marker_count);
  }
}

INSTANTIATE_TEST_SUITE_P(Diameters, PutAway, ::testing::Values(0.0, 0.04));

}  // namespace
}  // namespace rigcal::server::put_away_test
