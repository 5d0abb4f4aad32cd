// SPDX-License-Identifier: Apache-2.0
#include "client/results/calibration_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numbers>

#include "common/wire/camera_wire.h"
#include "tests/client/sample_messages.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::client::calibration_comparison_test {
namespace {

using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TrueCalibration;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

v1::Calibration FiveCameras(const std::string& id) {
  const SimulatedWorld world = *SimulatedWorld::Create(*ParseSimulationOptions("cameras=5;seed=2"),
                                                       *ParseTarget("wand:0,0.13,0.39"));
  v1::Calibration calibration = TrueCalibration(world);
  calibration.set_id(id);
  calibration.set_observation_digest("digest-" + id);
  return calibration;
}

// The same cameras in a rig frame of another place and direction.
void MoveRigFrame(v1::Calibration* calibration) {
  const RigidTransform old_from_new(
      Eigen::Quaterniond(Eigen::AngleAxisd(1.2, Eigen::Vector3d(1, 1, 0).normalized())),
      Eigen::Vector3d(3, -2, 1));
  for (v1::CalibratedCamera& camera : *calibration->mutable_cameras()) {
    const RigidTransform cam_from_old = *wire::FromProto(camera.cam_from_rig());
    *camera.mutable_cam_from_rig() = wire::ToProto(cam_from_old * old_from_new);
  }
}

TEST(Compare, AnotherRigFrameIsNoDifference) {
  v1::Calibration b = FiveCameras("b");
  MoveRigFrame(&b);
  ASSERT_OK_AND_ASSIGN(const CalibrationComparison comparison, Compare(FiveCameras("a"), b));
  ASSERT_EQ(comparison.cameras.size(), 5u);
  for (const CalibrationComparison::Camera& camera : comparison.cameras) {
    EXPECT_LT(camera.difference.position_m, 1e-9);
    EXPECT_LT(camera.difference.rotation_deg, 1e-9);
    EXPECT_EQ(camera.mean_px_a, 0.5);
  }
  EXPECT_FALSE(comparison.same_observations);
}

TEST(Compare, ReportsACameraThatTurned) {
  v1::Calibration b = FiveCameras("b");
  MoveRigFrame(&b);
  v1::CalibratedCamera* turned = b.mutable_cameras(3);
  const RigidTransform new_from_cam(
      Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 180, Eigen::Vector3d::UnitY())),
      Eigen::Vector3d::Zero());
  *turned->mutable_cam_from_rig() =
      wire::ToProto(new_from_cam * *wire::FromProto(turned->cam_from_rig()));
  turned->set_time_offset_s(turned->time_offset_s() + 0.004);
  turned->mutable_residuals()->mutable_all()->set_mean_px(2.5);
  ASSERT_OK_AND_ASSIGN(const CalibrationComparison comparison, Compare(FiveCameras("a"), b));
  EXPECT_EQ(comparison.cameras[3].camera, "sim_3");
  EXPECT_NEAR(comparison.cameras[3].difference.rotation_deg, 1, 1e-5);
  EXPECT_NEAR(comparison.max_difference.rotation_deg, 1, 1e-5);
  EXPECT_NEAR(comparison.cameras[1].difference.rotation_deg, 0, 1e-5);
  EXPECT_NEAR(comparison.cameras[3].time_offset_difference_s, 0.004, 1e-12);
  EXPECT_EQ(comparison.cameras[3].mean_px_b, 2.5);
}

TEST(Compare, NamesCamerasThatOnlyOneHas) {
  v1::Calibration a = FiveCameras("a");
  v1::Calibration b = FiveCameras("b");
  a.mutable_cameras(0)->set_camera("old");
  b.mutable_cameras(0)->set_camera("new");
  ASSERT_OK_AND_ASSIGN(const CalibrationComparison comparison, Compare(a, b));
  EXPECT_EQ(comparison.cameras.size(), 4u);
  EXPECT_THAT(comparison.only_in_a, ElementsAre("old"));
  EXPECT_THAT(comparison.only_in_b, ElementsAre("new"));
  EXPECT_THAT(FormatComparison(comparison),
              AllOf(HasSubstr("only in A: old"), HasSubstr("only in B: new")));
}

TEST(Compare, RefusesWhatCannotBeCompared) {
  const v1::Calibration a = FiveCameras("a");
  v1::Calibration running = FiveCameras("b");
  running.set_state(v1::Calibration::STATE_RUNNING);
  EXPECT_THAT(Compare(a, running), StatusIs(absl::StatusCode::kFailedPrecondition,
                                            AllOf(HasSubstr("b"), HasSubstr("running"))));
  v1::Calibration unscaled = FiveCameras("b");
  unscaled.set_scale_known(false);
  EXPECT_THAT(Compare(unscaled, a),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("scale")));
  v1::Calibration strangers = FiveCameras("b");
  for (v1::CalibratedCamera& camera : *strangers.mutable_cameras()) {
    camera.set_camera("x" + camera.camera());
  }
  EXPECT_THAT(Compare(a, strangers),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("in common")));
}

TEST(ComparisonJson, HasUnitsInItsNames) {
  CalibrationComparison comparison;
  comparison.id_a = "a";
  comparison.id_b = "b";
  comparison.cameras.push_back({.camera = "left",
                                .difference = {.position_m = 0.5, .rotation_deg = 180},
                                .time_offset_difference_s = 0.25,
                                .mean_px_a = 1,
                                .mean_px_b = 2});
  comparison.max_difference.position_m = 0.5;
  comparison.same_observations = true;
  EXPECT_EQ(nlohmann::json::parse(ToJson(comparison)),
            nlohmann::json::parse(R"({"a": "a", "b": "b", "cameras": [{"camera": "left",
                "position_difference_m": 0.5, "rotation_difference_deg": 180.0,
                "time_offset_difference_s": 0.25, "mean_px_a": 1.0, "mean_px_b": 2.0}],
                "only_in_a": [], "only_in_b": [], "max_position_difference_m": 0.5,
                "max_rotation_difference_deg": 0.0, "same_observations": true})"));
}

TEST(FormatComparison, IsInMillimetresAndDegrees) {
  CalibrationComparison comparison;
  comparison.cameras.push_back({.camera = "left",
                                .difference = {.position_m = 0.0015, .rotation_deg = 0.0573},
                                .mean_px_a = 1,
                                .mean_px_b = 2});
  EXPECT_THAT(FormatComparison(comparison),
              AllOf(HasSubstr("position (mm)"), HasSubstr(" 1.500  "), HasSubstr(" 0.0573  ")));
}

}  // namespace
}  // namespace rigcal::client::calibration_comparison_test
