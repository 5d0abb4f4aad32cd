// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/held_out.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/associate/clean_track.h"
#include "server/solve/rig/rig_solver.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::held_out_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;

constexpr int64_t kMillisecond = 1'000'000;

TEST(TimeBlocks, BeginAndEndWhereTheySay) {
  const TimeBlocks blocks;  // 2 s, every fourth
  EXPECT_TRUE(blocks.IsHeldOut(0, 0));
  EXPECT_TRUE(blocks.IsHeldOut(2000 * kMillisecond - 1, 0));
  EXPECT_FALSE(blocks.IsHeldOut(2000 * kMillisecond, 0));
  EXPECT_TRUE(blocks.IsHeldOut(2000 * kMillisecond, 1));
  EXPECT_TRUE(blocks.IsHeldOut(8000 * kMillisecond, 0));
  EXPECT_FALSE(blocks.IsHeldOut(8000 * kMillisecond - 1, 0));
}

TEST(TimeBlocks, GoOnBeforeTheirOrigin) {
  const TimeBlocks blocks;
  EXPECT_TRUE(blocks.IsHeldOut(-1, 3));
  EXPECT_TRUE(blocks.IsHeldOut(-2000 * kMillisecond, 3));
  EXPECT_FALSE(blocks.IsHeldOut(-2000 * kMillisecond - 1, 3));
  EXPECT_TRUE(blocks.IsHeldOut(-2000 * kMillisecond - 1, 2));
}

TEST(TimeBlocks, CountFromTheirOrigin) {
  TimeBlocks blocks;
  blocks.origin_ns = 1'700'000'000'000'000'123;
  EXPECT_TRUE(blocks.IsHeldOut(blocks.origin_ns, 0));
  EXPECT_FALSE(blocks.IsHeldOut(blocks.origin_ns - 1, 0));
  EXPECT_TRUE(blocks.IsHeldOut(blocks.origin_ns + 2'000'000'000, 1));
}

TEST(TimeBlocks, HaveAGuardOnBothSidesOfWhatIsHeldOut) {
  const TimeBlocks blocks;
  // Held out with remainder 1: 2 s to 4 s.
  EXPECT_TRUE(blocks.IsKept(1800 * kMillisecond - 1, 1));
  EXPECT_FALSE(blocks.IsKept(1800 * kMillisecond, 1));
  EXPECT_FALSE(blocks.IsKept(3000 * kMillisecond, 1));
  EXPECT_FALSE(blocks.IsKept(4200 * kMillisecond - 1, 1));
  EXPECT_TRUE(blocks.IsKept(4200 * kMillisecond, 1));
}

TEST(TimeBlocks, PutEveryInstantOnOneSideAtMostAndEvaluateItOnce) {
  TimeBlocks blocks;
  blocks.origin_ns = -7 * kMillisecond;
  for (int64_t time_ns = -20'000 * kMillisecond; time_ns < 20'000 * kMillisecond;
       time_ns += 7 * kMillisecond) {
    int evaluated = 0, kept = 0;
    for (int remainder = 0; remainder < blocks.period; ++remainder) {
      const bool held_out = blocks.IsHeldOut(time_ns, remainder);
      EXPECT_FALSE(held_out && blocks.IsKept(time_ns, remainder)) << time_ns;
      evaluated += held_out ? 1 : 0;
      kept += blocks.IsKept(time_ns, remainder) ? 1 : 0;
    }
    EXPECT_EQ(evaluated, 1) << time_ns;
    EXPECT_GE(kept, 2) << time_ns;
    EXPECT_LE(kept, 3) << time_ns;
  }
}

TEST(TimeBlocks, NoTwoSidesComeNearerThanTheGuard) {
  const TimeBlocks blocks;
  for (int remainder = 0; remainder < blocks.period; ++remainder) {
    int64_t last_held_out = -1, last_kept = -1, nearest = blocks.block_ns;
    for (int64_t time_ns = 0; time_ns < 16'000 * kMillisecond; time_ns += kMillisecond) {
      if (blocks.IsHeldOut(time_ns, remainder)) {
        if (last_kept >= 0) nearest = std::min(nearest, time_ns - last_kept);
        last_held_out = time_ns;
      } else if (blocks.IsKept(time_ns, remainder)) {
        if (last_held_out >= 0) nearest = std::min(nearest, time_ns - last_held_out);
        last_kept = time_ns;
      }
    }
    EXPECT_GE(nearest, blocks.guard_ns);
    EXPECT_LT(nearest, blocks.guard_ns + 3 * kMillisecond);
  }
}

// ---- the choice ----

EvaluatedErrors Errors(size_t reprojections, double reprojection_px, size_t left_out,
                       double left_out_px) {
  EvaluatedErrors errors;
  errors.reprojection_px.push_back(std::vector<double>(reprojections, reprojection_px));
  errors.leave_one_out_px.push_back(std::vector<double>(left_out, left_out_px));
  return errors;
}

TEST(ChoiceScorePx, PrefersTheCameraLeftOutWhereThereIsEnough) {
  EXPECT_DOUBLE_EQ(ChoiceScorePx(Errors(100, 0.5, 30, 0.75)), 0.75);
  EXPECT_DOUBLE_EQ(ChoiceScorePx(Errors(100, 0.5, 29, 0.75)), 0.5);
}

TEST(ChoiceScorePx, IsInfiniteWithoutErrors) {
  EXPECT_TRUE(std::isinf(ChoiceScorePx({})));
  EXPECT_TRUE(std::isinf(ChoiceScorePx(Errors(29, 0.5, 0, 0))));
}

TEST(ChoiceScorePx, WeighsCamerasTheSameAndSkipsThoseWithoutErrors) {
  EvaluatedErrors errors;
  errors.leave_one_out_px = {std::vector<double>(90, 1.0), std::vector<double>(10, 3.0), {}};
  EXPECT_DOUBLE_EQ(ChoiceScorePx(errors), 2);
}

// ---- evaluation ----

struct Solved {
  RigObservations rig;
  RigSolution solution;
  RigSolveOptions options;
};

Solved Solve(const std::string& text) {
  const auto world = SimulatedWorld::Create(*ParseSimulationOptions(text), WandTarget());
  EXPECT_THAT(world, IsOk());
  const CalibrationInput input = InputOf(*world);
  std::vector<ClockCorrection> clocks;
  Solved solved;
  solved.rig = RigOf(input, &clocks);
  auto solution = SolveRig(solved.rig, clocks, solved.options);
  EXPECT_THAT(solution, IsOk());
  if (solution.ok()) solved.solution = *std::move(solution);
  return solved;
}

double Mean(const std::vector<std::vector<double>>& errors) {
  double sum = 0, count = 0;
  for (const std::vector<double>& camera : errors) {
    for (const double error : camera) sum += error;
    count += static_cast<double>(camera.size());
  }
  return sum / count;
}

TEST(EvaluateSolution, MeasuresTheSelectedInstantsOnly) {
  const Solved solved = Solve("cameras=4;duration=12;noise=0.3");
  std::set<int64_t> asked;
  const EvaluatedErrors all =
      EvaluateSolution(solved.rig, solved.solution, solved.options, [&](int64_t time_ns) {
        asked.insert(time_ns);
        return true;
      });
  const EvaluatedErrors none =
      EvaluateSolution(solved.rig, solved.solution, solved.options, [](int64_t) { return false; });
  EXPECT_EQ(none.instant_count, 0);
  for (const std::vector<double>& camera : none.reprojection_px) EXPECT_TRUE(camera.empty());
  EXPECT_TRUE(std::isinf(ChoiceScorePx(none)));
  const int64_t middle_ns = (*asked.begin() + *asked.rbegin()) / 2;
  const EvaluatedErrors first =
      EvaluateSolution(solved.rig, solved.solution, solved.options,
                       [&](int64_t time_ns) { return time_ns < middle_ns; });
  const EvaluatedErrors second =
      EvaluateSolution(solved.rig, solved.solution, solved.options,
                       [&](int64_t time_ns) { return time_ns >= middle_ns; });
  EXPECT_GT(first.instant_count, 50);
  EXPECT_EQ(first.instant_count + second.instant_count, all.instant_count);
}

TEST(EvaluateSolution, OfATrueCalibrationShowsTheNoise) {
  const Solved solved = Solve("cameras=4;duration=12;noise=0.3;outliers=0.03");
  const EvaluatedErrors errors =
      EvaluateSolution(solved.rig, solved.solution, solved.options, [](int64_t) { return true; });
  // The mean length of noise of 0.3 px in each coordinate is 0.376 px; leaving the camera out adds
  // what its others are uncertain.
  EXPECT_GT(Mean(errors.reprojection_px), 0.25);
  EXPECT_LT(Mean(errors.reprojection_px), 0.45);
  EXPECT_GT(Mean(errors.leave_one_out_px), Mean(errors.reprojection_px));
  EXPECT_LT(Mean(errors.leave_one_out_px), 1.5);
  for (const std::vector<double>& span : errors.lengths) EXPECT_GT(span.size(), 50u);
}

TEST(EvaluateSolution, SeesThatACameraIsNotWhereItIsSaidToBe) {
  Solved solved = Solve("cameras=4;duration=12;noise=0.3");
  const auto all = [](int64_t) { return true; };
  const double before_px =
      Mean(EvaluateSolution(solved.rig, solved.solution, solved.options, all).leave_one_out_px);
  solved.solution.built.problem.cameras[2].cam_from_rig.translation_m.x() += 0.02;
  const EvaluatedErrors moved = EvaluateSolution(solved.rig, solved.solution, solved.options, all);
  EXPECT_GT(Mean({moved.leave_one_out_px[2]}), 3 * before_px);
}

TEST(EvaluateSolution, TwoCamerasHaveNoneToLeaveOut) {
  const Solved solved = Solve("cameras=2;duration=12");
  const EvaluatedErrors errors =
      EvaluateSolution(solved.rig, solved.solution, solved.options, [](int64_t) { return true; });
  EXPECT_TRUE(errors.leave_one_out_px[0].empty());
  EXPECT_FALSE(errors.reprojection_px[0].empty());
  for (const std::vector<double>& span : errors.lengths) EXPECT_TRUE(span.empty());
  EXPECT_TRUE(std::isfinite(ChoiceScorePx(errors)));
}

}  // namespace
}  // namespace rigcal::server::held_out_test
