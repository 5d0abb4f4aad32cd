// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/random_wand_pose.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/camera/camera_model.h"

namespace rigcal::accuracy::random_wand_pose_test {
namespace {

const ImageSize kSize{1280, 1024};

Intrinsics Lens() {
  return {DistortionModel::kBrownConrady, 1250, 1248, 633, 517, {-0.22, 0.2, 5e-4, -7e-4, -0.16}};
}

TEST(RandomWandPose, IsVisibleAnywhereInTheImageAtEveryDistance) {
  const Target target = *ParseTarget("wand:0,0.13,0.39;diameter=0.04");
  int distance_bins[3] = {}, corners[4] = {}, edges = 0;
  for (uint64_t seed = 0; seed < 600; ++seed) {
    const auto wand = RandomWandPose(Lens(), kSize, target, {}, seed);
    ASSERT_TRUE(wand.has_value()) << seed;
    EXPECT_NEAR(wand->direction.norm(), 1, 1e-9);
    for (const double position_m : target.marker_positions_m) {
      const Eigen::Vector3d centre = wand->Marker(position_m).centre_m;
      EXPECT_GE(centre.norm(), 1.5);
      EXPECT_LE(centre.norm(), 6);
      Eigen::Vector2d pixel;
      ASSERT_TRUE(Project(Lens(), centre, &pixel));
      const double room_px = 1200 * 0.02 / centre.norm();
      EXPECT_GE(pixel.minCoeff(), 0.7 * room_px);
      EXPECT_LE(pixel.x(), 1279 - 0.7 * room_px);
      EXPECT_LE(pixel.y(), 1023 - 0.7 * room_px);
      const bool right = pixel.x() > 640, low = pixel.y() > 512;
      ++corners[(right ? 1 : 0) + (low ? 2 : 0)];
      if (std::abs(pixel.x() - 640) > 600 || std::abs(pixel.y() - 512) > 470) ++edges;
    }
    const double middle_m = wand->Marker(0.195).centre_m.norm();
    ++distance_bins[static_cast<int>(std::min(2.0, (middle_m - 1.5) / 1.5))];
  }
  for (const int count : distance_bins) EXPECT_GT(count, 140);
  for (const int count : corners) EXPECT_GT(count, 250);
  EXPECT_GT(edges, 30);
}

TEST(RandomWandPose, FollowsFromTheSeedAndMovesAsAsked) {
  const Target target = *ParseTarget("wand:0,0.13,0.39");
  RandomWandPoseOptions options;
  options.speed_m_s = 2;
  options.angular_speed_rad_s = 1;
  const auto a = RandomWandPose(Lens(), kSize, target, options, 5);
  const auto b = RandomWandPose(Lens(), kSize, target, options, 5);
  const auto c = RandomWandPose(Lens(), kSize, target, options, 6);
  EXPECT_EQ(a->origin_m, b->origin_m);
  EXPECT_NE(a->origin_m, c->origin_m);
  EXPECT_NEAR(a->Marker(0.195).velocity_m_s.norm(), 2, 1e-9);
  EXPECT_NEAR(a->angular_velocity_rad_s.norm(), 1, 1e-9);
  EXPECT_NEAR(a->angular_velocity_rad_s.dot(a->direction), 0, 1e-9);
}

TEST(RandomWandPose, SaysSoWhereNoneFits) {
  Target huge = *ParseTarget("wand:0,0.5,2");
  huge.marker_positions_m = {0, 5, 20};
  EXPECT_FALSE(RandomWandPose(Lens(), kSize, huge, {}, 1).has_value());
}

}  // namespace
}  // namespace rigcal::accuracy::random_wand_pose_test
