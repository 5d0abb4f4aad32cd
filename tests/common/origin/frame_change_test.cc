// SPDX-License-Identifier: Apache-2.0
#include "common/origin/frame_change.h"

#include <gtest/gtest.h>

#include <random>

#include "common/origin/frame_fit.h"
#include "tests/common/triangulate/true_result.h"

namespace rigcal {
namespace {

constexpr Eigen::Index kRows = 12;  // three cameras, the first of them the reference

RigidTransform Change() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.2, -1, 0.4).normalized())),
          Eigen::Vector3d(0.5, 1, -0.3)};
}

RigidTransform Disturbed(const RigidTransform& pose, const Eigen::VectorXd& by) {
  const Eigen::Vector3d turn = by.head<3>();
  const double angle = turn.norm();
  const Eigen::Quaterniond rotation(
      Eigen::AngleAxisd(angle, angle > 0 ? Eigen::Vector3d(turn / angle)
                                         : Eigen::Vector3d(Eigen::Vector3d::UnitX())));
  return {rotation * pose.rotation, pose.translation_m + by.tail<3>()};
}

CalibrationResult Calibration(Eigen::MatrixXd* covariance) {
  SimulationOptions simulation;
  simulation.camera_count = 3;
  Target wand;
  wand.marker_positions_m = {0, 0.13, 0.39};
  CalibrationResult calibration = testing::TrueResult(*SimulatedWorld::Create(simulation, wand));
  calibration.reference_camera = "sim_0";
  calibration.wand_volume = WandVolume{Eigen::Vector3d(-1, -1, 1), Eigen::Vector3d(1, 1, 2)};
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd root =
      1e-4 * Eigen::MatrixXd::NullaryExpr(kRows, kRows, [&] { return normal(random); });
  *covariance = root * root.transpose();
  calibration.camera_covariance = PackLowerTriangle(*covariance);
  return calibration;
}

TEST(ChangeFrame, KeepsWhatTheCamerasSee) {
  Eigen::MatrixXd covariance;
  const CalibrationResult calibration = Calibration(&covariance);
  FrameChange change;
  change.new_from_rig = Change();
  const CalibrationResult moved = ChangeFrame(calibration, change);
  const Eigen::Vector3d point(0.1, 0.2, 1.4);
  for (size_t c = 0; c < 3; ++c) {
    const Eigen::Vector3d before = calibration.cameras[c].cam_from_rig * point;
    const Eigen::Vector3d after = moved.cameras[c].cam_from_rig * (Change() * point);
    EXPECT_NEAR((before - after).norm(), 0, 1e-12);
    ASSERT_TRUE(moved.cameras[c].uncertainty.has_value());
  }
  EXPECT_EQ(moved.reference_camera, "");
  ASSERT_TRUE(moved.wand_volume.has_value());
  EXPECT_GT((moved.wand_volume->max_m - moved.wand_volume->min_m).norm(), 3 - 1e-9);
}

// Draws calibrations from the old covariance, and changes of the frame that follow them; the poses
// in the new frame scatter as the new covariance says.
TEST(ChangeFrame, TransformsTheCovarianceWithTheFramesOwn) {
  Eigen::MatrixXd covariance;
  const CalibrationResult calibration = Calibration(&covariance);
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto draw = [&](Eigen::Index size) {
    return Eigen::VectorXd(Eigen::VectorXd::NullaryExpr(size, [&] { return normal(random); }));
  };
  FrameChange change;
  change.new_from_rig = Change();
  change.by_parameters = Eigen::MatrixXd::NullaryExpr(6, kRows, [&] { return normal(random); });
  change.own_covariance = 4e-8 * Eigen::Matrix<double, 6, 6>::Identity();
  const CalibrationResult moved = ChangeFrame(calibration, change);
  const CameraCovariance stated = UnpackCameraCovariance(moved);
  ASSERT_EQ(stated.matrix.rows(), 18);

  const Eigen::MatrixXd root = covariance.llt().matrixL();
  constexpr int kDraws = 4000;
  Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(18, 18);
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::VectorXd parameters = root * draw(kRows);
    const Eigen::VectorXd frame = change.by_parameters * parameters + 2e-4 * draw(6);
    const RigidTransform new_from_rig = Disturbed(Change(), frame);
    Eigen::VectorXd errors(18);
    for (Eigen::Index c = 0; c < 3; ++c) {
      RigidTransform cam_from_rig = calibration.cameras[static_cast<size_t>(c)].cam_from_rig;
      if (c > 0) cam_from_rig = Disturbed(cam_from_rig, parameters.segment(6 * (c - 1), 6));
      errors.segment<6>(6 * c) = FrameDifference(moved.cameras[static_cast<size_t>(c)].cam_from_rig,
                                                 cam_from_rig * new_from_rig.Inverse());
    }
    scatter += errors * errors.transpose() / kDraws;
  }
  for (Eigen::Index i = 0; i < 18; ++i) {
    for (Eigen::Index j = 0; j < 18; ++j) {
      const double scale = std::sqrt(stated.matrix(i, i) * stated.matrix(j, j));
      // Six sigmas of a correlation of so many draws.
      EXPECT_NEAR(scatter(i, j) / scale, stated.matrix(i, j) / scale, 0.12) << i << " " << j;
    }
  }
}

TEST(ChangeFrame, WithoutACovarianceThereIsNone) {
  Eigen::MatrixXd covariance;
  CalibrationResult calibration = Calibration(&covariance);
  calibration.camera_covariance.clear();
  const CalibrationResult moved = ChangeFrame(calibration, {});
  EXPECT_TRUE(moved.camera_covariance.empty());
  EXPECT_FALSE(moved.cameras[1].uncertainty.has_value());
}

}  // namespace
}  // namespace rigcal
