// SPDX-License-Identifier: Apache-2.0
// The whole solve with static points.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::static_target_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Ne;
using ::testing::SizeIs;

// Of the points that were found, from where they are, in the rig frame of the reference camera.
double WorstPointM(const CalibratedTarget& target, const CalibrationResult& result,
                   const SimulatedWorld& world) {
  const auto& cameras = world.cameras();
  const auto reference = std::ranges::find_if(cameras, [&result](const SimulatedCamera& camera) {
    return camera.description.camera == result.reference_camera;
  });
  double worst_m = 0;
  for (const CalibratedPoint& found : target.static_points) {
    const auto point =
        std::ranges::find(world.true_target().points, found.label, &TargetPoint::label);
    const Eigen::Vector3d truth_m =
        reference->cam_from_rig * Eigen::Vector3d(point->x_m, point->y_m, point->z_m);
    worst_m = std::max(worst_m, (found.position_m - truth_m).norm());
  }
  return worst_m;
}

// The session of static points comes first, and its cameras' clocks are 3 s off: neither matters.
TEST(StaticTarget, PointsAreFoundBesideAWandWhichGivesScaleAndClocks) {
  const auto worlds =
      WorldsOf("cameras=4;duration=20;rate=10;offset.1=0.004", {StaticTarget(20), WandTarget()});
  CalibrationInput input = MixedInputOf(worlds);
  for (CameraTrack& track : input.tracks) {
    if (track.session_id != "s0" || track.camera.camera != "sim_2") continue;
    for (Observation& row : track.observations) row.time_ns += 3'000'000'000;
  }
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(std::move(input), options);
  ASSERT_THAT(outcome.result, IsOk());
  const CalibrationResult& result = *outcome.result;
  EXPECT_EQ(result.solver_path, SolverPath::kGeneral);
  EXPECT_TRUE(result.scale_known);
  EXPECT_THAT(result.quality.grade, Ne(QualityGrade::kBad));
  EXPECT_EQ(result.target.given, WandTarget());
  ASSERT_THAT(result.other_targets, SizeIs(1));
  const CalibratedTarget& room = result.other_targets.front();
  EXPECT_EQ(room.given, StaticTarget(20));
  EXPECT_THAT(room.session_ids, ElementsAre("s0"));
  EXPECT_GT(room.static_points.size(), 15u);
  EXPECT_LT(WorstPointM(room, result, worlds[0]), 0.01);
  EXPECT_LT(ComparePoses(result, worlds[0]).worst_position_m, 0.01);
  std::vector<double> offsets_s;
  for (const CalibratedCamera& camera : result.cameras) {
    EXPECT_TRUE(camera.time_offset_estimated);
    offsets_s.push_back(camera.time_offset_s);
  }
  EXPECT_NEAR(offsets_s[1] - (offsets_s[0] + offsets_s[2] + offsets_s[3]) / 3, 0.004, 0.0003);
}

TEST(StaticTarget, PointsHoldTheRigWhereTheWandWasWavedBriefly) {
  const std::string rig = "cameras=4;duration=8;rate=10;seed=5";
  const auto worlds = WorldsOf(rig, {WandTarget(), StaticTarget(60)});
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = options.marker_positions = Estimate::kFixed;
  const CalibrationOutcome with = Calibrate(MixedInputOf(worlds), options);
  CalibrationInput input = MixedInputOf(worlds);
  std::erase_if(input.tracks, [](const CameraTrack& track) { return track.session_id == "s1"; });
  input.other_targets.clear();
  const CalibrationOutcome without = Calibrate(std::move(input), options);
  ASSERT_THAT(with.result, IsOk());
  ASSERT_THAT(without.result, IsOk());
  const auto sigma_m = [](const CalibrationResult& result) {
    double sum = 0;
    for (const CalibratedCamera& camera : result.cameras) {
      sum += camera.uncertainty->position_sigma_m.norm();
    }
    return sum;
  };
  EXPECT_LT(sigma_m(*with.result), 0.9 * sigma_m(*without.result));
}

// Beside a single point, which has no length either.
TEST(StaticTarget, BesideAPointTheScaleStaysUnknown) {
  const auto worlds = WorldsOf("cameras=3;duration=20;rate=10", {PointTarget(), StaticTarget(20)});
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(MixedInputOf(worlds), options);
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_FALSE(outcome.result->scale_known);
  EXPECT_EQ(outcome.result->solver_path, SolverPath::kLineKernel);
  EXPECT_LT(outcome.result->cameras[0].residuals.inlier.rms_px, 0.5);
  ASSERT_THAT(outcome.result->other_targets, SizeIs(1));
  EXPECT_GT(outcome.result->other_targets[0].static_points.size(), 10u);
}

TEST(StaticTarget, AloneTheyLeaveClocksAsTheyWere) {
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(
      InputOf(WorldOf("cameras=3;duration=4;rate=10;offset.1=0.004", StaticTarget(80))), options);
  ASSERT_THAT(outcome.result, IsOk());
  const CalibrationResult& result = *outcome.result;
  EXPECT_FALSE(result.scale_known);
  EXPECT_EQ(result.target.given, StaticTarget(80));
  for (const CalibratedCamera& camera : result.cameras) {
    EXPECT_EQ(camera.time_offset_s, 0);
    EXPECT_EQ(camera.time_rate_ppm, 0);
    EXPECT_FALSE(camera.time_offset_estimated);
    EXPECT_LT(camera.residuals.inlier.rms_px, 0.3);  // means of many rows
  }
}

// A survey gives the scale, and is known better than the wand.
TEST(StaticTarget, ASurveyGivesTheScale) {
  Target survey = BodyTarget(0.0005);
  survey.kind = TargetKind::kStatic;
  survey.is_surveyed = true;
  for (TargetPoint& point : survey.points) {
    point.x_m *= 6, point.y_m *= 6, point.z_m *= 4;
  }
  const auto worlds = WorldsOf("cameras=4;duration=20;rate=10", {WandTarget(), survey});
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(MixedInputOf(worlds), options);
  ASSERT_THAT(outcome.result, IsOk());
  const CalibrationResult& result = *outcome.result;
  EXPECT_LT(ComparePoses(result, worlds[0]).worst_position_m, 0.003);
  EXPECT_LT(result.target.scale_sigma_rel, 0.001);
  ASSERT_THAT(result.other_targets, SizeIs(1));
  EXPECT_THAT(result.other_targets[0].static_points, SizeIs(12));
  EXPECT_LT(WorstPointM(result.other_targets[0], result, worlds[1]), 0.005);
}

TEST(StaticTarget, ASurveyAloneIsRefusedWithWhatToDo) {
  Target survey = BodyTarget(0.001);
  survey.kind = TargetKind::kStatic;
  survey.is_surveyed = true;
  EXPECT_THAT(Calibrate(InputOf(WorldOf("cameras=3;duration=2;rate=5", survey)), {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("wave one")));
}

TEST(StaticTarget, RefusesASplineOfWhatDoesNotMove) {
  CalibrationInput input;
  input.target = StaticTarget(5);
  CalibrationOptions options;
  options.trajectory = TrajectoryChoice::kSpline;
  EXPECT_THAT(Calibrate(std::move(input), options).result,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("static points")));
}

}  // namespace
}  // namespace rigcal::server::static_target_test
