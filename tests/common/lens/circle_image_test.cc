// SPDX-License-Identifier: Apache-2.0
#include "common/lens/circle_image.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/common/lens/known_lens.h"

namespace rigcal::circle_image_test {
namespace {

using namespace rigcal::testing;  // the known lens

TEST(CircleOffset, IsTheExactOneOfAnEllipseWithoutDistortion) {
  // A circle of radius r, tilted by t at distance z, straight ahead: its image reaches from
  // -f r cos t / (z + r sin t) to f r cos t / (z - r sin t), so that the middle of the ellipse is
  // f r^2 sin t cos t / (z^2 - r^2 sin^2 t) from the image of the centre.
  const Intrinsics lens{.model = DistortionModel::kBrownConrady,
                        .fx_px = 1000,
                        .fy_px = 1000,
                        .cx_px = 500,
                        .cy_px = 400,
                        .distortion = {0, 0, 0, 0, 0}};
  const double r = 0.01, z = 0.5, t = M_PI / 4;
  RigidTransform pose;
  pose.rotation = Eigen::AngleAxisd(t, Eigen::Vector3d::UnitX());
  pose.translation_m = {0, 0, z};
  Eigen::Vector2d offset_px;
  ASSERT_TRUE(CircleOffset(lens, pose, Eigen::Vector3d::Zero(), r, &offset_px));
  const double expected =
      1000 * r * r * std::sin(t) * std::cos(t) / (z * z - r * r * std::sin(t) * std::sin(t));
  EXPECT_NEAR(expected, 0.2, 0.001);
  EXPECT_NEAR(offset_px.x(), 0, 1e-9);
  EXPECT_NEAR(std::abs(offset_px.y()), expected, 0.002 * expected);
  // The near half of the circle is larger: the offset points to the side that is nearer.
  EXPECT_LT(offset_px.y(), 0);
}

TEST(CircleOffset, GrowsWithTheSquareOfTheRadius) {
  const Intrinsics lens = KnownFisheye();
  RigidTransform pose;
  pose.rotation = Eigen::AngleAxisd(0.9, Eigen::Vector3d::UnitY());
  pose.translation_m = {0.1, -0.05, 0.3};
  Eigen::Vector2d small, large;
  ASSERT_TRUE(CircleOffset(lens, pose, Eigen::Vector3d::Zero(), 0.004, &small));
  ASSERT_TRUE(CircleOffset(lens, pose, Eigen::Vector3d::Zero(), 0.008, &large));
  EXPECT_NEAR(large.norm() / small.norm(), 4, 0.05);
  EXPECT_GT(small.norm(), 1e-4);
}

TEST(CircleOffset, NothingBehindTheCamera) {
  RigidTransform pose;
  pose.translation_m = {0, 0, 0.005};
  Eigen::Vector2d offset_px;
  pose.rotation = Eigen::AngleAxisd(1.2, Eigen::Vector3d::UnitX());
  EXPECT_FALSE(CircleOffset(KnownPinhole(), pose, Eigen::Vector3d::Zero(), 0.01, &offset_px));
}

}  // namespace
}  // namespace rigcal::circle_image_test
