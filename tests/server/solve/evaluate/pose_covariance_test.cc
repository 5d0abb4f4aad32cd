// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/pose_covariance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::server::pose_covariance_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

// Three cameras, the first of which is held; the second one's intrinsics were refined.
CalibrationResult Calibration() {
  CalibrationResult result;
  result.scale_known = true;
  result.reference_camera = "a";
  for (int c = 0; c < 3; ++c) {
    CalibratedCamera camera;
    camera.camera = std::string(1, static_cast<char>('a' + c));
    camera.image_size_px = {1280, 1024};
    camera.intrinsics = {DistortionModel::kBrownConrady, 500, 500, 640, 512, {}};
    camera.intrinsics_refined = c == 1;
    camera.cam_from_rig = {
        Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * c, Eigen::Vector3d(1, 2, 3).normalized())),
        Eigen::Vector3d(1.0 * c, -0.3 * c, 0.2 * c)};
    result.cameras.push_back(camera);
  }
  const int size = 6 + 9 + 6;  // a pose, four and five values of a lens, a pose
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j <= i; ++j) {
      result.camera_covariance.push_back(i == j ? 1e-6 * (i + 1) : 1e-8 * (i + j));
    }
  }
  return result;
}

TEST(PoseCovariance, LeavesOutIntrinsicsAndTheReference) {
  ASSERT_OK_AND_ASSIGN(const RigPoses poses, PosesOf(Calibration()));
  ASSERT_EQ(poses.covariance.rows(), 18);
  EXPECT_EQ(poses.covariance.topRows(6).norm(), 0);
  EXPECT_DOUBLE_EQ(poses.covariance(6, 6), 1e-6);
  EXPECT_DOUBLE_EQ(poses.covariance(12, 12), 1e-6 * 16);
  EXPECT_DOUBLE_EQ(poses.covariance(12, 7), 1e-8 * (15 + 1));
  EXPECT_DOUBLE_EQ(poses.covariance(7, 12), 1e-8 * (15 + 1));
  EXPECT_EQ(poses.Find("c"), 2);
  EXPECT_EQ(poses.Find("d"), -1);
}

TEST(PoseCovariance, GivenIntrinsicsLeaveLess) {
  ASSERT_OK_AND_ASSIGN(const RigPoses marginal, PosesOf(Calibration()));
  ASSERT_OK_AND_ASSIGN(const RigPoses given, PosesOf(Calibration(), {"b"}));
  ASSERT_OK_AND_ASSIGN(const RigPoses other, PosesOf(Calibration(), {"a", "c"}));
  EXPECT_EQ(other.covariance, marginal.covariance);
  EXPECT_LT(given.covariance(6, 6), marginal.covariance(6, 6));
  EXPECT_GT(given.covariance(6, 6), 0.9 * marginal.covariance(6, 6));
  // Of one row alone: the part that its correlation with the intrinsics explains is gone.
  EXPECT_LT((given.covariance - given.covariance.transpose()).norm(), 1e-18);
}

TEST(PoseCovariance, RefusesWhatHasNone) {
  CalibrationResult result = Calibration();
  result.camera_covariance.pop_back();
  EXPECT_THAT(PosesOf(result),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("no covariance")));
  result = Calibration();
  result.scale_known = false;
  EXPECT_THAT(PosesOf(result), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("scale")));
}

// The variance of what does not depend on the frame, here the distance of two cameras, is the same
// whichever camera is held.
double DistanceVariance(const RigPoses& poses, int from, int to) {
  Eigen::VectorXd gradient(poses.covariance.rows());
  const auto distance = [&](const std::vector<RigidTransform>& moved) {
    return (moved[static_cast<size_t>(from)].SourceFromTargetTranslation() -
            moved[static_cast<size_t>(to)].SourceFromTargetTranslation())
        .norm();
  };
  for (Eigen::Index i = 0; i < gradient.size(); ++i) {
    constexpr double kStep = 1e-6;
    double side[2];
    for (const int sign : {0, 1}) {
      std::vector<RigidTransform> moved = poses.cam_from_rig;
      RigidTransform& pose = moved[static_cast<size_t>(i / 6)];
      Eigen::Vector3d step = Eigen::Vector3d::Zero();
      step[i % 3] = sign == 0 ? -kStep : kStep;
      if (i % 6 < 3) {
        pose.rotation = Eigen::AngleAxisd(kStep, step.normalized()) * pose.rotation;
      } else {
        pose.translation_m += step;
      }
      side[sign] = distance(moved);
    }
    gradient[i] = (side[1] - side[0]) / (2 * kStep);
  }
  return gradient.dot(poses.covariance * gradient);
}

TEST(PoseCovariance, AnotherHeldCameraChangesNothingWithinTheRig) {
  ASSERT_OK_AND_ASSIGN(const RigPoses before, PosesOf(Calibration()));
  RigPoses after = before;
  HoldFixed(2, &after);
  EXPECT_LT(after.covariance.bottomRows(6).norm(), 1e-12);
  EXPECT_GT(after.covariance.topRows(6).norm(), 1e-6);
  for (const auto& [from, to] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)}) {
    EXPECT_NEAR(DistanceVariance(after, from, to) / DistanceVariance(before, from, to), 1, 1e-4);
  }
}

TEST(PoseCovariance, AnotherFrameChangesNothingWithinTheRig) {
  ASSERT_OK_AND_ASSIGN(const RigPoses before, PosesOf(Calibration()));
  RigPoses after = before;
  const RigidTransform pose(Eigen::Quaterniond(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitY())),
                            Eigen::Vector3d(3, 1, -2));
  MoveToFrameOf(0, pose, &after);
  EXPECT_LT((after.cam_from_rig[0].Matrix() - pose.Matrix()).norm(), 1e-12);
  EXPECT_LT(after.covariance.topRows(6).norm(), 1e-12);
  for (const auto& [from, to] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)}) {
    EXPECT_NEAR(DistanceVariance(after, from, to) / DistanceVariance(before, from, to), 1, 1e-4);
  }
}

}  // namespace
}  // namespace rigcal::server::pose_covariance_test
