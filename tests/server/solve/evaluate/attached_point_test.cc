// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/attached_point.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace rigcal::server::attached_point_test {
namespace {

using ::testing::DoubleNear;
using ::testing::Each;
using ::testing::Lt;

// Four cameras in a square of 4 m, 1 m above the middle of the volume, that look at it.
const Eigen::Vector3d kMiddle(0.5, -0.2, 0);
std::vector<RigidTransform> Square() {
  std::vector<RigidTransform> poses;
  for (int c = 0; c < 4; ++c) {
    const double angle = M_PI / 2 * c;
    const Eigen::Vector3d centre =
        kMiddle + Eigen::Vector3d(2 * std::cos(angle), 2 * std::sin(angle), 1);
    RigidTransform pose;
    pose.rotation = Eigen::Quaterniond::FromTwoVectors(kMiddle - centre, Eigen::Vector3d::UnitZ());
    pose.translation_m = -(pose.rotation * centre);
    poses.push_back(pose);
  }
  return poses;
}

TEST(AttachedPoint, AnotherFrameIsNoDifference) {
  const std::vector<RigidTransform> poses = Square();
  RigidTransform moved;
  moved.rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized());
  moved.translation_m = {3, -1, 2};
  std::vector<RigidTransform> others;
  others.reserve(poses.size());
  for (const RigidTransform& pose : poses) others.push_back(pose * moved);
  EXPECT_THAT(FrameFreeCentreDistances(poses, others, kMiddle), Each(Lt(1e-12)));
}

TEST(AttachedPoint, AnErrorOfTheReferenceCameraIsMostlyItsOwn) {
  // Seen from the reference camera all others are 10 mm off, and turned by 1 mrad about it.
  const std::vector<RigidTransform> poses = Square();
  RigidTransform off;
  off.rotation = Eigen::AngleAxisd(0.001, Eigen::Vector3d::UnitX());
  off.translation_m = {0.01, 0, 0};
  std::vector<RigidTransform> others = poses;
  others[0] = off * poses[0];
  const std::vector<double> errors_m = FrameFreeCentreDistances(poses, others, kMiddle);
  // The best motion of all shares it out.
  EXPECT_LT(errors_m[0], 0.01);
  for (size_t c = 1; c < 4; ++c) EXPECT_LT(errors_m[c], errors_m[0]);
  EXPECT_GT(errors_m[0], 0.003);
}

TEST(AttachedPoint, TwoCamerasKeepWhatTheirDistanceDoesNotSay) {
  // One of them goes around the volume and still looks at its middle from as far: after the best
  // motion the error is shared by both.
  const std::vector<RigidTransform> square = Square();
  const std::vector<RigidTransform> poses = {square[0], square[1]};
  RigidTransform around;
  around.rotation = Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitZ());
  around.translation_m = kMiddle - around.rotation * kMiddle;
  const std::vector<RigidTransform> others = {poses[0], poses[1] * around};
  EXPECT_THAT(FrameFreeCentreDistances(poses, others, kMiddle),
              Each(DoubleNear(0.5 * 2 * 0.01, 0.004)));
}

TEST(AttachedPoint, SigmasAreTheRootMeanSquaresOfTheDistances) {
  // Draws of poses from a covariance in which cameras 1 to 3 share what camera 0, the reference,
  // does not know of itself.
  BundleProblem problem;
  for (const RigidTransform& pose : Square()) {
    problem.cameras.emplace_back();
    problem.cameras.back().cam_from_rig = pose;
  }
  RigUncertainty rig;
  for (int c = 1; c < 4; ++c) {
    for (const ReducedParameterKind kind :
         {ReducedParameterKind::kRotation, ReducedParameterKind::kTranslation}) {
      for (int i = 0; i < 3; ++i) rig.parameters.push_back({kind, c, i});
    }
  }
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0, 1e-3);
  const auto draw = [&](Eigen::Index rows, Eigen::Index columns) {
    return Eigen::MatrixXd(
        Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random); }));
  };
  const Eigen::MatrixXd root = draw(18, 24);
  rig.shape_covariance = rig.covariance = root * root.transpose();
  std::vector<double> sums_m2(4);
  constexpr int kDraws = 4000;
  for (int k = 0; k < kDraws; ++k) {
    const Eigen::VectorXd moved = 1e3 * root * draw(24, 1);
    std::vector<RigidTransform> others = Square();
    for (Eigen::Index c = 1; c < 4; ++c) {
      const Eigen::Vector3d turn = moved.segment<3>(6 * (c - 1));
      RigidTransform& pose = others[static_cast<size_t>(c)];
      pose.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * pose.rotation;
      pose.translation_m += moved.segment<3>(6 * (c - 1) + 3);
    }
    const std::vector<double> distances_m = FrameFreeCentreDistances(Square(), others, kMiddle);
    for (size_t c = 0; c < 4; ++c) sums_m2[c] += distances_m[c] * distances_m[c];
  }
  // The mean of 4000 squares is known to about 2 %, its root to 1 %.
  const std::vector<double> sigmas_m = FrameFreeCentreSigmas(problem, rig, kMiddle);
  for (size_t c = 0; c < 4; ++c) EXPECT_NEAR(std::sqrt(sums_m2[c] / kDraws) / sigmas_m[c], 1, 0.04);
}

}  // namespace
}  // namespace rigcal::server::attached_point_test
