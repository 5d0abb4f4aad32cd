// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/restart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "server/associate/clean_track.h"
#include "server/solve/evaluate/evaluated_solve.h"
#include "server/solve/rig/rig_solver.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::restart_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

struct World {
  RigObservations rig;
  std::vector<ClockCorrection> clocks;
  std::vector<RigidTransform> true_poses;  // in the frame of camera 0
};

World MakeWorld(const std::string& options) {
  const auto simulated = SimulatedWorld::Create(*ParseSimulationOptions(options), WandTarget());
  EXPECT_THAT(simulated, IsOk());
  const CalibrationInput input = InputOf(*simulated);
  World world;
  world.rig = RigOf(input, &world.clocks);
  const RigidTransform reference = simulated->cameras()[0].cam_from_rig;
  for (const SimulatedCamera& camera : simulated->cameras()) {
    world.true_poses.push_back(camera.cam_from_rig * reference.Inverse());
  }
  return world;
}

// At the ground truth but for one camera, which is turned by half a turn about the vertical through
// a point before the reference camera.
RigInitialization MirroredStart(const World& world, const RigSolution& right, size_t wrong) {
  RigInitialization start = InitializationFrom(right);
  start.clocks = world.clocks;
  start.instants.clear();
  const Eigen::Vector3d middle(0, 0, 2.5);
  const Eigen::Quaterniond half(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()));
  RigidTransform& pose = start.cameras[wrong].cam_from_rig;
  pose = pose * RigidTransform(half, middle - half * middle);
  return start;
}

// As seen from camera 0.
double WorstPositionM(const World& world, const RigSolution& solution) {
  const std::vector<BundleCamera>& cameras = solution.built.problem.cameras;
  double worst_m = 0;
  for (size_t c = 0; c < cameras.size(); ++c) {
    const RigidTransform pose = cameras[c].cam_from_rig * cameras[0].cam_from_rig.Inverse();
    const Eigen::Vector3d error_m =
        pose.SourceFromTargetTranslation() - world.true_poses[c].SourceFromTargetTranslation();
    worst_m = std::max(worst_m, error_m.norm());
  }
  return worst_m;
}

TEST(RestartIfWrong, LeavesASolutionAloneThatEveryCameraAgreesWith) {
  const World world = MakeWorld("cameras=4;duration=15;outliers.1=0.3;swaps=0.05;dropouts=0.3");
  auto solution = SolveRig(world.rig, world.clocks, {});
  ASSERT_THAT(solution, IsOk());
  const RigidTransform before = solution->built.problem.cameras[1].cam_from_rig;
  ASSERT_OK_AND_ASSIGN(const auto finding, RestartIfWrong(world.rig, world.clocks, {}, &*solution));
  EXPECT_FALSE(finding);
  EXPECT_EQ(solution->built.problem.cameras[1].cam_from_rig.translation_m, before.translation_m);
}

TEST(RestartIfWrong, FindsAPoseAnewFromWhatTheOtherCamerasSee) {
  const World world = MakeWorld("cameras=5;duration=15;outliers=0.05");
  const auto right = SolveRig(world.rig, world.clocks, {});
  ASSERT_THAT(right, IsOk());
  ASSERT_LT(WorstPositionM(world, *right), 0.02);
  for (const size_t wrong : {size_t{1}, size_t{0}}) {  // the reference, too
    const RigInitialization start = MirroredStart(world, *right, wrong);
    auto solution = SolveRig(world.rig, world.clocks, {}, &start);
    ASSERT_THAT(solution, IsOk());
    ASSERT_GT(WorstPositionM(world, *solution), 0.2) << "this start is no trap";
    ASSERT_OK_AND_ASSIGN(const auto finding,
                         RestartIfWrong(world.rig, world.clocks, {}, &*solution));
    ASSERT_TRUE(finding);
    EXPECT_EQ(finding->kind, FindingKind::kRestarted);
    EXPECT_EQ(finding->camera, world.rig.index.cameras[wrong].camera);
    EXPECT_LT(finding->value, 2);
    EXPECT_THAT(finding->advice, HasSubstr("from what the other cameras see"));
    EXPECT_LT(WorstPositionM(world, *solution), 0.02);
  }
}

// Two cameras have nobody to be placed by, and one pair.
TEST(RestartIfWrong, StartsFromNothingWhereNoTwoCamerasCanBeTrusted) {
  const World world = MakeWorld("cameras=2;duration=20");
  const auto right = SolveRig(world.rig, world.clocks, {});
  ASSERT_THAT(right, IsOk());
  const RigInitialization start = MirroredStart(world, *right, 1);
  auto solution = SolveRig(world.rig, world.clocks, {}, &start);
  ASSERT_THAT(solution, IsOk());
  ASSERT_GT(WorstPositionM(world, *solution), 0.2) << "this start is no trap";
  ASSERT_OK_AND_ASSIGN(const auto finding, RestartIfWrong(world.rig, world.clocks, {}, &*solution));
  ASSERT_TRUE(finding);
  EXPECT_THAT(finding->advice, HasSubstr("from other pairs"));
  EXPECT_LT(WorstPositionM(world, *solution), 0.03);
}

TEST(RestartIfWrong, StopsWhenCancelled) {
  const World world = MakeWorld("cameras=5;duration=15;outliers=0.05");
  const auto right = SolveRig(world.rig, world.clocks, {});
  ASSERT_THAT(right, IsOk());
  const RigInitialization start = MirroredStart(world, *right, 1);
  auto solution = SolveRig(world.rig, world.clocks, {}, &start);
  ASSERT_THAT(solution, IsOk());
  const std::atomic<bool> cancelled = true;
  RigSolveOptions options;
  options.cancelled = &cancelled;
  EXPECT_THAT(RestartIfWrong(world.rig, world.clocks, options, &*solution),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("")));
}

TEST(SolveAndEvaluate, IsRescuedFromAWrongMinimumAndSaysSo) {
  const World world = MakeWorld("cameras=5;duration=15;outliers=0.05");
  const auto right = SolveRig(world.rig, world.clocks, {});
  ASSERT_THAT(right, IsOk());
  const RigInitialization start = MirroredStart(world, *right, 1);
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  for (const RigInitialization* first : {&start, static_cast<const RigInitialization*>(nullptr)}) {
    const auto evaluated = SolveAndEvaluate(world.rig, world.clocks, {}, options, first);
    ASSERT_THAT(evaluated, IsOk());
    EXPECT_LT(WorstPositionM(world, evaluated->solution), 0.02);
    int restarts = 0;
    for (const Finding& finding : evaluated->findings)
      restarts += finding.kind == FindingKind::kRestarted;
    EXPECT_EQ(restarts, first == nullptr ? 0 : 1);
  }
}

TEST(MeasureAgreement, DoubtsTheWorstFirstAndNobodyWithFewMarkers) {
  BundleProblem problem;
  problem.target.marker_positions_m = {0};
  problem.cameras.resize(4);
  for (BundleCamera& camera : problem.cameras) {
    camera.intrinsics = IntrinsicsVector::Zero(9);
    camera.intrinsics[0] = camera.intrinsics[1] = 1000;
  }
  problem.clocks.resize(1);
  constexpr int kInstants = 40;
  const double wrong[] = {0, 0.75, 0.5, 1};
  for (int i = 0; i < kInstants; ++i) {
    BundleInstant instant;
    instant.origin_m = {0, 0, 2};
    instant.first_observation = static_cast<int>(problem.observations.size());
    for (int c = 0; c < 4; ++c) {
      if (c == 3 && i >= 20) continue;
      problem.observations.push_back({c, 0, 0, static_cast<int>(problem.markers.size()), 1});
      BundleMarker marker;
      if (i < wrong[c] * kInstants) marker.centre_px.x() = c == 2 ? NAN : 100;
      problem.markers.push_back(marker);
      ++instant.observation_count;
    }
    problem.instants.push_back(instant);
  }
  const Agreement agreement = MeasureAgreement(problem);
  EXPECT_EQ(agreement.doubted, (std::vector<int>{1, 2}));
  EXPECT_THAT(agreement.shares, ::testing::ElementsAre(1, 0.25, 0.5, 1));
  EXPECT_NEAR(agreement.error_px, 20.0 * (30 + 20 + 20) / (3 * kInstants + 20), 1e-9);
}

}  // namespace
}  // namespace rigcal::server::restart_test
