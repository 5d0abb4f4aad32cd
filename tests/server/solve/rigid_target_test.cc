// SPDX-License-Identifier: Apache-2.0
// The whole solve with rigid targets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::rigid_target_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;
using ::testing::Ne;

TEST(RigidTarget, IsSolvedByTheGeneralPath) {
  const SimulatedWorld world =
      WorldOf("cameras=3;duration=8;rate=10;offset.1=0.004", BodyTarget(0));
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(InputOf(world), options);
  ASSERT_THAT(outcome.result, IsOk());
  const CalibrationResult& result = *outcome.result;
  EXPECT_EQ(result.solver_path, SolverPath::kGeneral);
  EXPECT_TRUE(result.scale_known);
  EXPECT_EQ(result.target.scale_sigma_rel, 0);
  EXPECT_THAT(result.quality.grade, Ne(QualityGrade::kBad));
  const PoseErrors errors = ComparePoses(result, world);
  EXPECT_LT(errors.worst_position_m, 0.002);
  EXPECT_LT(errors.worst_rotation_rad, 0.001);
  for (const CalibratedCamera& camera : result.cameras) {
    ASSERT_TRUE(camera.uncertainty);
    ASSERT_TRUE(camera.held_out);
    ASSERT_TRUE(camera.leave_one_out);
    EXPECT_LT(camera.leave_one_out->mean_px, 0.8);
    if (camera.camera == result.reference_camera) continue;
    EXPECT_GT(camera.uncertainty->position_sigma_m.minCoeff(), 0);
    EXPECT_LT(camera.uncertainty->position_sigma_m.maxCoeff(), 0.003);
  }
  const double offset_s = result.cameras[1].time_offset_s -
                          0.5 * (result.cameras[0].time_offset_s + result.cameras[2].time_offset_s);
  EXPECT_NEAR(offset_s, 0.004, 0.0003);
}

TEST(RigidTarget, APlaneIsSolvedWithItsPointsAsGiven) {
  const SimulatedWorld world =
      WorldOf("cameras=3;duration=6;rate=5;dropouts=0.1;seed=3", PlaneTarget(0));
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(InputOf(world), options);
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_LT(ComparePoses(*outcome.result, world).worst_position_m, 0.002);
  EXPECT_FALSE(outcome.result->target.spans.size() > 0);
  EXPECT_EQ(outcome.result->target.given, world.target());
}

// Points that were built 1 mm off: estimated they cost nothing, taken as exact they show.
TEST(RigidTarget, PointsAreEstimatedUnderTheirSigma) {
  const std::string text = "cameras=3;duration=8;rate=8;length_sigma=0.001;outliers=0";
  const SimulatedWorld rough = WorldOf(text, BodyTarget(0.001)),
                       exact = WorldOf(text, BodyTarget(0));
  CalibrationOptions options;
  options.time_offsets = options.intrinsics = Estimate::kFixed;
  const CalibrationOutcome estimated = Calibrate(InputOf(rough), options);
  const CalibrationOutcome as_given = Calibrate(InputOf(exact), options);
  ASSERT_THAT(estimated.result, IsOk());
  ASSERT_THAT(as_given.result, IsOk());
  EXPECT_TRUE(estimated.result->target.marker_positions_estimated);
  // Twelve points of 1 mm within 0.15 m: about 1 / (0.1 sqrt(3 * 12)) = 0.2 %.
  EXPECT_GT(estimated.result->target.scale_sigma_rel, 0.0005);
  EXPECT_LT(estimated.result->target.scale_sigma_rel, 0.004);
  const auto rms_px = [](const CalibrationResult& result) {
    return result.cameras[0].residuals.inlier.rms_px;
  };
  EXPECT_LT(rms_px(*estimated.result), 0.45);
  EXPECT_GT(rms_px(*as_given.result), 1.05 * rms_px(*estimated.result));
}

TEST(RigidTarget, AWandIsSolvedByTheKernel) {
  const CalibrationOutcome outcome =
      Calibrate(InputOf(WorldOf("cameras=3;duration=10", WandTarget())), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(outcome.result->solver_path, SolverPath::kLineKernel);
}

TEST(RigidTarget, RefusesASecondScale) {
  CalibrationOptions options;
  options.known_distance = KnownDistance{"sim_0", "sim_1", 3, 0};
  const CalibrationOutcome outcome =
      Calibrate(InputOf(WorldOf("cameras=3;duration=2", BodyTarget(0))), options);
  EXPECT_THAT(outcome.result, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("distance")));
}

}  // namespace
}  // namespace rigcal::server::rigid_target_test
