// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/time_check.h"

#include <gtest/gtest.h>

#include <utility>

#include "server/solve/evaluate/evaluated_solve.h"
#include "server/solve/rig/rig_solver.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::time_check_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;

RigObservations Rig(const std::string& options, std::vector<ClockCorrection>* clocks) {
  const auto world = SimulatedWorld::Create(*ParseSimulationOptions(options), WandTarget());
  EXPECT_THAT(world, IsOk());
  return RigOf(InputOf(*world), clocks);
}

TEST(FindBetterOffset, LeavesARigThatIsMatchedRightlyAlone) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = Rig("cameras=4;duration=20;outliers=0.05;offset.1=0.004", &clocks);
  const auto solution = SolveRig(rig, clocks, {});
  ASSERT_THAT(solution, IsOk());
  EXPECT_FALSE(FindBetterOffset(rig, *solution));
}

TEST(FindBetterOffset, NamesTheClockAndTheTime) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = Rig("cameras=4;duration=20;outliers=0.05", &clocks);
  const auto solution = SolveRig(rig, clocks, {});
  ASSERT_THAT(solution, IsOk());
  for (const int clock : {0, 2}) {  // the reference's, too
    for (const double off_s : {0.06, -0.4, 0.93}) {
      RigSolution wrong = *solution;
      wrong.clocks[static_cast<size_t>(clock)].time_offset_s += off_s;
      const auto doubt = FindBetterOffset(rig, wrong);
      ASSERT_TRUE(doubt) << clock << " " << off_s;
      EXPECT_EQ(doubt->clock, clock);
      EXPECT_NEAR(doubt->offset_s, -off_s, 0.004);
      EXPECT_LT(doubt->there_px, 0.4 * doubt->here_px);
    }
  }
}

TEST(FindBetterOffset, CannotCheckTwoClocks) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = Rig("cameras=2;duration=20", &clocks);
  auto solution = SolveRig(rig, clocks, {});
  ASSERT_THAT(solution, IsOk());
  solution->clocks[1].time_offset_s += 0.3;
  EXPECT_FALSE(FindBetterOffset(rig, *solution));
}

// The clocks are such as a search that was fooled would leave.
TEST(SolveAndEvaluate, IsRescuedFromAWrongMatchOfTimes) {
  for (const auto& [clock, off_s] : {std::pair<size_t, double>{3, 0.85}, {0, 0.35}}) {
    std::vector<ClockCorrection> clocks;
    const RigObservations rig = Rig("cameras=5;duration=30;offset.3=0.003", &clocks);
    clocks[clock].time_offset_s = off_s;
    CalibrationOptions options;
    options.intrinsics = Estimate::kFixed;
    const auto evaluated = SolveAndEvaluate(rig, clocks, {}, options);
    ASSERT_THAT(evaluated, IsOk());
    const std::vector<ClockCorrection> found = InitializationFrom(evaluated->solution).clocks;
    for (size_t k = 0; k < found.size(); ++k) {
      EXPECT_NEAR(found[k].time_offset_s - found[1].time_offset_s, k == 3 ? 0.003 : 0, 0.0005) << k;
    }
  }
}

}  // namespace
}  // namespace rigcal::server::time_check_test
