// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/time_search.h"

#include <gtest/gtest.h>

#include "server/solve/clocks/epipolar_score.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::time_search_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;

RigObservations Rig(const std::string& options, std::vector<ClockCorrection>* clocks) {
  const auto world = SimulatedWorld::Create(*ParseSimulationOptions(options), WandTarget());
  EXPECT_THAT(world, IsOk());
  return RigOf(InputOf(*world), clocks);
}

TEST(SearchTimeOffsets, FindsOffsetsWithinTheReachOfTheFirstOrder) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig =
      Rig("cameras=4;duration=30;outliers=0.05;offset.1=0.45;offset.3=-0.8", &clocks);
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks), IsOk());
  EXPECT_EQ(clocks[0].time_offset_s, 0);
  EXPECT_NEAR(clocks[1].time_offset_s, 0.45, 0.01);
  EXPECT_EQ(clocks[2].time_offset_s, 0);
  EXPECT_NEAR(clocks[3].time_offset_s, -0.8, 0.01);
}

// Those between what an instant may be wide and what looks like another wave included.
TEST(SearchTimeOffsets, FindsOffsetsOfEverySize) {
  for (const double offset_s : {0.012, -0.02, 0.033, -0.06, 0.085, -0.15, 0.3, -0.97}) {
    std::vector<ClockCorrection> clocks;
    const RigObservations rig =
        Rig("cameras=4;duration=30;offset.2=" + std::to_string(offset_s), &clocks);
    ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks), IsOk());
    for (size_t k = 0; k < clocks.size(); ++k) {
      EXPECT_NEAR(clocks[k].time_offset_s, k == 2 ? offset_s : 0, 0.004) << offset_s << ", " << k;
    }
  }
}

TEST(SearchTimeOffsets, LeavesAlignedClocksExactlyAsTheyAre) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = Rig("cameras=4;duration=30;offset.2=0.004", &clocks);
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks), IsOk());
  for (const ClockCorrection& clock : clocks) EXPECT_EQ(clock.time_offset_s, 0);
}

TEST(SearchTimeOffsets, ScoreIsLowestAtTheTruth) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = Rig("cameras=2;duration=30;offset.1=0.1", &clocks);
  const auto times = CoarseRigTimes(rig.tracks);
  const TrackPaths a = PathsOf(rig.tracks[0], times[0], times[0].front(), 3);
  const TrackPaths b = PathsOf(rig.tracks[1], times[1], times[0].front(), 3);
  const double truth = EpipolarScorePx(a, b, 0.1, kMinEpipolarMatches);
  EXPECT_LT(truth, 1);
  for (const double offset_s : {-0.5, 0.0, 0.08, 0.12, 0.6}) {
    EXPECT_GT(EpipolarScorePx(a, b, offset_s, kMinEpipolarMatches), 3 * truth) << offset_s;
  }
}

TEST(SearchTimeOffsets, StopsWhenCancelled) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = Rig("cameras=3;duration=10", &clocks);
  const std::atomic<bool> cancelled = true;
  EXPECT_EQ(SearchTimeOffsets(rig, 0, {{}, &cancelled}, &clocks).code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace rigcal::server::time_search_test
