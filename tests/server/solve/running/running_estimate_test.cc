// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/running_estimate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::running_estimate_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

SimulatedWorld World(const std::string& options) {
  auto world = SimulatedWorld::Create(*ParseSimulationOptions(options), WandTarget());
  EXPECT_THAT(world, IsOk());
  return *std::move(world);
}

// What has been seen up to a time.
RunningInput InputUntil(const SimulatedWorld& world, double time_s) {
  RunningInput input;
  input.target = world.target();
  input.tracks = InputOf(world).tracks;
  for (size_t c = 0; c < input.tracks.size(); ++c) {
    const auto count = static_cast<size_t>(time_s * world.cameras()[c].rate_hz);
    if (input.tracks[c].observations.size() > count) input.tracks[c].observations.resize(count);
  }
  return input;
}

// Of the estimate's baselines from the reference camera, against ground truth.
double WorstBaselineErrorM(const SimulatedWorld& world, const RunningEstimate& estimate) {
  const RigidTransform reference_from_world = world.cameras()[0].cam_from_rig;
  double worst_m = 0;
  for (size_t c = 1; c < estimate.cameras.size(); ++c) {
    const Eigen::Vector3d truth =
        reference_from_world * world.cameras()[c].cam_from_rig.SourceFromTargetTranslation();
    worst_m = std::max(
        worst_m, (estimate.cameras[c].cam_from_rig.SourceFromTargetTranslation() - truth).norm());
  }
  return worst_m;
}

TEST(RunningEstimate, FindsTheRigAndAClockThatIsOff) {
  const SimulatedWorld world = World("cameras=4;rate=50;duration=12;offset.2=-0.008;seed=3");
  const RunningOutcome outcome = EstimateNow(InputUntil(world, 12));
  ASSERT_THAT(outcome.problem, IsOk());
  ASSERT_TRUE(outcome.estimate);
  EXPECT_THAT(outcome.needs, IsEmpty());
  const RunningEstimate& estimate = *outcome.estimate;
  ASSERT_THAT(estimate.cameras, SizeIs(4));
  EXPECT_LT(WorstBaselineErrorM(world, estimate), 0.01);
  EXPECT_NEAR(estimate.cameras[2].time_offset_s - estimate.cameras[0].time_offset_s, -0.008,
              0.0005);
  EXPECT_LT(estimate.cameras[2].time_offset_sigma_s, 0.0005);
  EXPECT_NEAR(estimate.cameras[1].reprojection_rms_px, 0.42, 0.1);  // 0.3 px in two coordinates
  EXPECT_TRUE(estimate.scale_known);
  EXPECT_GT(estimate.error.p95_m, 1e-5);
  EXPECT_LT(estimate.error.p95_m, 0.01);
  EXPECT_LE(estimate.error.median_m, estimate.error.worst_m);
  EXPECT_THAT(estimate.wand_m, SizeIs(3));
}

TEST(RunningEstimate, GoesOnWhereTheLastOneEnded) {
  const SimulatedWorld world = World("cameras=4;rate=50;duration=20;offset.1=0.3;seed=4");
  RunningOutcome first = EstimateNow(InputUntil(world, 10));
  ASSERT_TRUE(first.estimate);
  RunningInput more = InputUntil(world, 20);
  more.start = first.estimate->next;
  const RunningOutcome warm = EstimateNow(std::move(more));
  const RunningOutcome cold = EstimateNow(InputUntil(world, 20));
  ASSERT_TRUE(warm.estimate);
  ASSERT_TRUE(cold.estimate);
  EXPECT_EQ(warm.estimate->next.round, 2);
  for (size_t c = 1; c < 4; ++c) {
    const Eigen::Vector3d difference_m = warm.estimate->cameras[c].cam_from_rig.translation_m -
                                         cold.estimate->cameras[c].cam_from_rig.translation_m;
    EXPECT_LT(difference_m.norm(), 0.003);
  }
  EXPECT_LT(warm.estimate->error.p95_m, first.estimate->error.p95_m);
}

TEST(RunningEstimate, EqualInputGivesEqualBits) {
  const SimulatedWorld world = World("cameras=3;rate=25;duration=10;seed=5");
  const RunningOutcome a = EstimateNow(InputUntil(world, 10));
  const RunningOutcome b = EstimateNow(InputUntil(world, 10));
  ASSERT_TRUE(a.estimate && b.estimate);
  EXPECT_EQ(a.estimate->error.p95_m, b.estimate->error.p95_m);
  EXPECT_EQ(a.estimate->cameras[2].cam_from_rig.translation_m,
            b.estimate->cameras[2].cam_from_rig.translation_m);
}

TEST(RunningEstimate, BeforeItCanSolveItSaysWhichPairsMissWhat) {
  const SimulatedWorld world = World("cameras=4;rate=25;duration=10;seed=1");
  RunningInput input = InputUntil(world, 1);  // 25 instants at most
  const RunningOutcome outcome = EstimateNow(std::move(input));
  EXPECT_THAT(outcome.problem, IsOk());
  EXPECT_FALSE(outcome.estimate);
  ASSERT_THAT(outcome.needs, SizeIs(3));  // as many as join four cameras
  for (const PairNeed& need : outcome.needs) {
    EXPECT_NE(need.camera_a, need.camera_b);
    EXPECT_LT(need.common_count, need.needed_count);
  }
}

TEST(RunningEstimate, SolvesWithoutACameraThatSharesNothing) {
  const SimulatedWorld world = World("cameras=4;rate=25;duration=15;seed=2");
  RunningInput input = InputUntil(world, 15);
  for (Observation& row : input.tracks[3].observations) {
    for (MarkerObservation& marker : row.markers) marker.visible = false;
  }
  const RunningOutcome outcome = EstimateNow(std::move(input));
  ASSERT_TRUE(outcome.estimate) << outcome.problem;
  EXPECT_THAT(outcome.estimate->cameras, SizeIs(3));
  ASSERT_THAT(outcome.needs, SizeIs(1));
  EXPECT_EQ(outcome.needs[0].camera_b, world.cameras()[3].description.camera);
  EXPECT_EQ(outcome.needs[0].common_count, 0);
}

TEST(RunningEstimate, NothingOrOneCameraIsNoFault) {
  RunningInput nothing;
  nothing.target = WandTarget();
  EXPECT_THAT(EstimateNow(std::move(nothing)).problem, IsOk());
  const SimulatedWorld world = World("cameras=3;duration=5;seed=1");
  RunningInput input = InputUntil(world, 5);
  input.tracks.resize(1);
  const RunningOutcome outcome = EstimateNow(std::move(input));
  EXPECT_THAT(outcome.problem, IsOk());
  EXPECT_FALSE(outcome.estimate);
}

TEST(RunningEstimate, AStartThatIsWrongIsLeft) {
  const SimulatedWorld world = World("cameras=4;rate=50;duration=10;seed=6");
  const RunningOutcome good = EstimateNow(InputUntil(world, 10));
  ASSERT_TRUE(good.estimate);
  RunningInput input = InputUntil(world, 10);
  input.start = good.estimate->next;
  std::swap(input.start.cameras[1].cam_from_rig, input.start.cameras[2].cam_from_rig);
  const RunningOutcome outcome = EstimateNow(std::move(input));
  ASSERT_TRUE(outcome.estimate) << outcome.problem;
  EXPECT_LT(WorstBaselineErrorM(world, *outcome.estimate), 0.01);
}

TEST(RunningEstimate, ThinnedDataStandForAll) {
  const SimulatedWorld world = World("cameras=4;rate=50;duration=30;seed=7");
  RunningInput few = InputUntil(world, 30), all = InputUntil(world, 30);
  few.max_views = 1'000;
  all.max_views = 1'000'000;
  const RunningOutcome thinned = EstimateNow(std::move(few)), full = EstimateNow(std::move(all));
  ASSERT_TRUE(thinned.estimate && full.estimate);
  EXPECT_EQ(thinned.estimate->instant_count, full.estimate->instant_count);
  EXPECT_NEAR(thinned.estimate->error.median_m / full.estimate->error.median_m, 1, 0.25);
}

TEST(RunningEstimate, KeepsTheGivenLensesWhereTheyAreRight) {
  const SimulatedWorld world = World("cameras=4;rate=50;duration=12;seed=9");
  const RunningOutcome outcome = EstimateNow(InputUntil(world, 12));
  ASSERT_TRUE(outcome.estimate) << outcome.problem;
  EXPECT_FALSE(outcome.estimate->intrinsics_refined);
  for (const EstimatedCamera& camera : outcome.estimate->cameras) {
    EXPECT_FALSE(camera.lens_disagrees) << camera.name;
  }
  ASSERT_TRUE(outcome.estimate->held_out);
  EXPECT_TRUE(outcome.estimate->held_out->agrees);
}

TEST(RunningEstimate, NamesTheCameraWhoseLensIsAnother) {
  const SimulatedWorld world = World("cameras=4;rate=50;duration=16;seed=9");
  RunningInput input = InputUntil(world, 16);
  input.tracks[2].camera.intrinsics->fx_px *= 1.01;
  input.tracks[2].camera.intrinsics->fy_px *= 1.01;
  const RunningOutcome outcome = EstimateNow(std::move(input));
  ASSERT_TRUE(outcome.estimate) << outcome.problem;
  EXPECT_TRUE(outcome.estimate->intrinsics_refined);
  for (size_t c = 0; c < 4; ++c) {
    EXPECT_EQ(outcome.estimate->cameras[c].lens_disagrees, c == 2) << c;
  }
  EXPECT_LT(WorstBaselineErrorM(world, *outcome.estimate), 0.02);
}

TEST(RunningEstimate, AdviceWouldHelp) {
  const SimulatedWorld world = World("cameras=6;rate=50;duration=8;seed=8");
  const RunningOutcome outcome = EstimateNow(InputUntil(world, 8));
  ASSERT_TRUE(outcome.estimate);
  ASSERT_THAT(outcome.estimate->advice, Not(IsEmpty()));
  double last_m = 0;
  for (const WaveAdvice& advice : outcome.estimate->advice) {
    EXPECT_LT(advice.expected_p95_m, outcome.estimate->error.p95_m);
    EXPECT_GE(advice.expected_p95_m, last_m);
    last_m = advice.expected_p95_m;
    EXPECT_GE(advice.cameras.size(), 2u);
    EXPECT_THAT(advice.text, ::testing::HasSubstr("wand "));
  }
}

}  // namespace
}  // namespace rigcal::server::running_estimate_test
