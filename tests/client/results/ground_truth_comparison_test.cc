// SPDX-License-Identifier: Apache-2.0
#include "client/results/ground_truth_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "common/wire/camera_wire.h"
#include "tests/client/sample_messages.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::client::ground_truth_comparison_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TrueCalibration;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

SimulatedWorld World(const char* options) {
  return *SimulatedWorld::Create(*ParseSimulationOptions(options),
                                 *ParseTarget("wand:0,0.13,0.39"));
}

TEST(CompareWithGroundTruth, TheTruthHasNoError) {
  const SimulatedWorld world = World("cameras=6;seed=4;offset.2=0.008;rate_ppm.3=50");
  ASSERT_OK_AND_ASSIGN(const GroundTruthComparison truth,
                       CompareWithGroundTruth(TrueCalibration(world), world));
  ASSERT_EQ(truth.cameras.size(), 6u);
  for (const GroundTruthComparison::Camera& camera : truth.cameras) {
    EXPECT_LT(camera.error.position_m, 1e-9);
    EXPECT_LT(camera.error.rotation_deg, 1e-7);
    EXPECT_NEAR(camera.time_offset_error_s, 0, 1e-12);
  }
  EXPECT_LT(truth.max_error.position_m, 1e-9);
  ASSERT_TRUE(truth.point_error_m.has_value());
  EXPECT_LT(*truth.point_error_m, 1e-6);
}

TEST(CompareWithGroundTruth, AlignsAnUnknownScaleAndSaysSo) {
  const SimulatedWorld world = World("cameras=6");
  v1::Calibration calibration = TrueCalibration(world);
  ASSERT_OK_AND_ASSIGN(const GroundTruthComparison metric,
                       CompareWithGroundTruth(calibration, world));
  EXPECT_EQ(metric.unit_length_m, 0);
  calibration.set_scale_known(false);
  for (v1::CalibratedCamera& camera : *calibration.mutable_cameras()) {
    RigidTransform cam_from_rig = *wire::FromProto(camera.cam_from_rig());
    cam_from_rig.translation_m /= 2.5;
    *camera.mutable_cam_from_rig() = wire::ToProto(cam_from_rig);
  }
  ASSERT_OK_AND_ASSIGN(const GroundTruthComparison truth,
                       CompareWithGroundTruth(calibration, world));
  EXPECT_NEAR(truth.unit_length_m, 2.5, 1e-9);
  EXPECT_FALSE(truth.point_error_m.has_value());
  EXPECT_LT(truth.max_error.position_m, 1e-9);
  EXPECT_LT(truth.max_error.rotation_deg, 1e-6);
  // The same in metres is wrong by more than the half of everything.
  calibration.set_scale_known(true);
  ASSERT_OK_AND_ASSIGN(const GroundTruthComparison shrunk,
                       CompareWithGroundTruth(calibration, world));
  EXPECT_GT(shrunk.max_error.position_m, 1);
}

TEST(CompareWithGroundTruth, FindsTheErrorOfOneCamera) {
  const SimulatedWorld world = World("cameras=6");
  v1::Calibration calibration = TrueCalibration(world);
  v1::CalibratedCamera* wrong = calibration.mutable_cameras(4);
  RigidTransform cam_from_rig = *wire::FromProto(wrong->cam_from_rig());
  // The whole camera 6 mm along its own x axis.
  cam_from_rig.translation_m.x() -= 0.006;
  *wrong->mutable_cam_from_rig() = wire::ToProto(cam_from_rig);
  wrong->set_time_offset_s(wrong->time_offset_s() + 0.002);
  ASSERT_OK_AND_ASSIGN(const GroundTruthComparison truth,
                       CompareWithGroundTruth(calibration, world));
  EXPECT_EQ(truth.cameras[4].camera, "sim_4");
  // The alignment takes a part of it over to the others.
  EXPECT_GT(truth.cameras[4].error.position_m, 0.003);
  EXPECT_LT(truth.cameras[4].error.position_m, 0.006);
  EXPECT_EQ(truth.max_error.position_m, truth.cameras[4].error.position_m);
  // A point is triangulated from up to six cameras, one of which is 6 mm off.
  ASSERT_TRUE(truth.point_error_m.has_value());
  EXPECT_GT(*truth.point_error_m, 0.0005);
  EXPECT_LT(*truth.point_error_m, 0.006);
  EXPECT_LT(truth.cameras[1].error.position_m, 0.003);
  EXPECT_GT(truth.max_error.rotation_deg, 0);
  EXPECT_NEAR(truth.cameras[4].time_offset_error_s, 0.002, 1e-12);
  EXPECT_NEAR(truth.cameras[0].time_offset_error_s, 0, 1e-12);
}

TEST(CompareWithGroundTruth, ANeglectedOffsetIsAnErrorOfItsSize) {
  const SimulatedWorld world = World("cameras=4;offset.2=0.008");
  v1::Calibration calibration = TrueCalibration(world);
  for (v1::CalibratedCamera& camera : *calibration.mutable_cameras()) camera.set_time_offset_s(0);
  ASSERT_OK_AND_ASSIGN(const GroundTruthComparison truth,
                       CompareWithGroundTruth(calibration, world));
  EXPECT_NEAR(truth.cameras[2].time_offset_error_s, -0.008, 1e-12);
  EXPECT_NEAR(truth.cameras[0].time_offset_error_s, 0, 1e-12);
}

TEST(CompareWithGroundTruth, ACommonShiftOfTimeIsNoError) {
  const SimulatedWorld world = World("cameras=5;offset.1=0.1");
  v1::Calibration calibration = TrueCalibration(world);
  for (v1::CalibratedCamera& camera : *calibration.mutable_cameras()) {
    camera.set_time_offset_s(camera.time_offset_s() + 42);
  }
  ASSERT_OK_AND_ASSIGN(const GroundTruthComparison truth,
                       CompareWithGroundTruth(calibration, world));
  for (const GroundTruthComparison::Camera& camera : truth.cameras) {
    EXPECT_NEAR(camera.time_offset_error_s, 0, 1e-12);
  }
}

TEST(CompareWithGroundTruth, ClocksWithOriginsOfTheirOwnCompareInTheirOwnTime) {
  const SimulatedWorld world = World("cameras=3;clock_samples=1;rate_ppm.1=20");
  v1::Calibration calibration = TrueCalibration(world);
  for (int i = 0; i < 3; ++i) {
    const SimulatedCamera& truth = world.cameras()[static_cast<size_t>(i)];
    const double origin_s = static_cast<double>(truth.clock_origin_ns) * 1e-9;
    calibration.mutable_cameras(i)->set_time_epoch_s(origin_s + 30);
    calibration.mutable_cameras(i)->set_time_offset_s(-origin_s + truth.time_rate_ppm * 1e-6 * 30);
  }
  ASSERT_OK_AND_ASSIGN(const GroundTruthComparison comparison,
                       CompareWithGroundTruth(calibration, world));
  for (const GroundTruthComparison::Camera& camera : comparison.cameras) {
    EXPECT_NEAR(camera.time_offset_error_s, 0, 1e-9);
  }
}

TEST(CompareWithGroundTruth, WorksForTwoCameras) {
  const SimulatedWorld world = World("cameras=2");
  ASSERT_OK_AND_ASSIGN(const GroundTruthComparison truth,
                       CompareWithGroundTruth(TrueCalibration(world), world));
  EXPECT_LT(truth.max_error.position_m, 1e-9);
  EXPECT_LT(truth.max_error.rotation_deg, 1e-6);
}

TEST(CompareWithGroundTruth, RefusesWhatCannotBeCompared) {
  const SimulatedWorld world = World("cameras=3");
  v1::Calibration failed = TrueCalibration(world);
  failed.set_state(v1::Calibration::STATE_FAILED);
  EXPECT_THAT(CompareWithGroundTruth(failed, world),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("failed")));
  v1::Calibration stranger = TrueCalibration(world);
  stranger.mutable_cameras(1)->set_camera("other");
  EXPECT_THAT(CompareWithGroundTruth(stranger, world),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("other")));
  v1::Calibration without_pose = TrueCalibration(world);
  without_pose.mutable_cameras(1)->clear_cam_from_rig();
  EXPECT_THAT(CompareWithGroundTruth(without_pose, world),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rotation")));
}

}  // namespace
}  // namespace rigcal::client::ground_truth_comparison_test
