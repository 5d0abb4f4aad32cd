// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/calibration_errors.h"

#include <Eigen/Geometry>
#include <string>

#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::calibration_errors_test {
namespace {

using ::rigcal::testing::ParseSimulationOptions;

SimulatedWorld World(const std::string& options) {
  return *SimulatedWorld::Create(*ParseSimulationOptions(options),
                                 *ParseTarget("wand:0,0.13,0.39"));
}

// The result of a solver that knows everything. Epochs as if each camera's first row were at 2 s.
CalibrationResult Perfect(const SimulatedWorld& world, int reference) {
  CalibrationResult result;
  result.reference_camera = world.cameras()[static_cast<size_t>(reference)].description.camera;
  for (int c = 0; c < static_cast<int>(world.cameras().size()); ++c) {
    const SimulatedCamera& truth = world.cameras()[static_cast<size_t>(c)];
    CalibratedCamera camera;
    camera.camera = truth.description.camera;
    camera.cam_from_rig = TruePose(world, c, reference);
    camera.intrinsics = truth.true_intrinsics;
    camera.intrinsics_refined = true;
    const double origin_s = 1e-9 * static_cast<double>(truth.clock_origin_ns);
    camera.time_epoch_s = origin_s + 2;
    camera.time_rate_ppm = truth.time_rate_ppm;
    camera.time_offset_s = -origin_s + truth.time_offset_s + 2e-6 * truth.time_rate_ppm;
    result.cameras.push_back(camera);
  }
  result.target.marker_positions_m = world.true_target().marker_positions_m;
  return result;
}

const char kOptions[] =
    "seed=4;cameras=4;offset.1=0.3;offset.2=-0.1;rate_ppm.2=500;length_sigma=0.002;"
    "focal_sigma=0.005";

TEST(CompareWithGroundTruth, FindsNothingWrongWithThePerfectResult) {
  const SimulatedWorld world = World(kOptions);
  ASSERT_OK_AND_ASSIGN(const CalibrationErrors errors,
                       CompareWithGroundTruth(world, Perfect(world, 1)));
  EXPECT_EQ(errors.reference, 1);
  EXPECT_LT(errors.PositionRmsM(), 1e-12);
  EXPECT_NEAR(errors.scale_rel, 0, 1e-12);
  for (const CameraError& camera : errors.cameras) {
    EXPECT_EQ(camera.is_reference, camera.index == 1);
    EXPECT_LT(camera.pose.rotation_rad.norm(), 1e-7);
    EXPECT_NEAR(camera.time_offset_s, 0, 1e-12);
    EXPECT_NEAR(camera.time_rate_ppm, 0, 1e-12);
    EXPECT_EQ(camera.intrinsics, std::vector<double>(9, 0.0));
  }
  EXPECT_EQ(errors.marker_positions_m, (std::vector<double>{0, 0}));
}

TEST(CompareWithGroundTruth, MeasuresEachErrorByItself) {
  const SimulatedWorld world = World(kOptions);
  CalibrationResult result = Perfect(world, 0);
  result.cameras[2].time_offset_s += 1e-3;
  result.cameras[3].time_rate_ppm -= 7;
  result.cameras[1].intrinsics.cx_px += 2;
  result.cameras[3].intrinsics_refined = false;
  result.target.marker_positions_m[2] += 0.004;
  const Eigen::Vector3d turn(0.001, -0.002, 0.003);
  result.cameras[1].cam_from_rig =
      RigidTransform(Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized())),
                     Eigen::Vector3d::Zero()) *
      result.cameras[1].cam_from_rig;
  result.cameras[1].cam_from_rig.translation_m -=
      result.cameras[1].cam_from_rig.rotation * Eigen::Vector3d(0, 0, 0.01);
  ASSERT_OK_AND_ASSIGN(const CalibrationErrors errors, CompareWithGroundTruth(world, result));
  EXPECT_LT((errors.cameras[1].pose.rotation_rad - turn).norm(), 1e-9);
  EXPECT_LT((errors.cameras[1].pose.position_m - Eigen::Vector3d(0, 0, 0.01)).norm(), 1e-9);
  EXPECT_NEAR(errors.cameras[1].intrinsics[2], 2, 1e-9);
  EXPECT_TRUE(errors.cameras[3].intrinsics.empty());
  EXPECT_NEAR(errors.cameras[2].time_offset_s, 1e-3, 1e-12);
  EXPECT_NEAR(errors.cameras[0].time_offset_s, 0, 1e-12);
  EXPECT_NEAR(errors.cameras[3].time_rate_ppm - errors.cameras[0].time_rate_ppm, -7, 1e-9);
  EXPECT_NEAR(errors.marker_positions_m[1], 0.004, 1e-12);
  EXPECT_NEAR(errors.target_length_rel, 0.004 / world.true_target().marker_positions_m[2], 1e-12);
}

TEST(CompareWithGroundTruth, ScaleIsApartFromShapeAndTheRigFrameDoesNotMatter) {
  const SimulatedWorld world = World(kOptions);
  CalibrationResult result = Perfect(world, 0);
  const RigidTransform rig_from_other(Eigen::Quaterniond(0.6, 0, 0.8, 0), {1, 2, 3});
  for (CalibratedCamera& camera : result.cameras) {
    camera.cam_from_rig.translation_m *= 1.01;
    camera.cam_from_rig = camera.cam_from_rig * rig_from_other;
  }
  ASSERT_OK_AND_ASSIGN(const CalibrationErrors errors, CompareWithGroundTruth(world, result));
  EXPECT_NEAR(errors.scale_rel, 0.01, 1e-9);
  for (const Eigen::Vector3d& shape : errors.shape_m) EXPECT_LT(shape.norm(), 1e-9);
  EXPECT_GT(errors.PositionRmsM(), 0.02);
  for (double& position_m : result.target.marker_positions_m) position_m *= 1.01;
  ASSERT_OK_AND_ASSIGN(const CalibrationErrors longer, CompareWithGroundTruth(world, result));
  EXPECT_NEAR(longer.target_length_rel, 0.01, 1e-12);
  for (size_t c = 0; c < 4; ++c) EXPECT_LT(longer.PositionErrorAtTrueLengthM(c).norm(), 1e-9);
}

TEST(CompareWithGroundTruth, RefusesAResultWithoutACamera) {
  const SimulatedWorld world = World(kOptions);
  CalibrationResult result = Perfect(world, 0);
  result.cameras.pop_back();
  EXPECT_FALSE(CompareWithGroundTruth(world, result).ok());
  result = Perfect(world, 0);
  result.reference_camera = "somebody";
  EXPECT_FALSE(CompareWithGroundTruth(world, result).ok());
}

}  // namespace
}  // namespace rigcal::accuracy::calibration_errors_test
