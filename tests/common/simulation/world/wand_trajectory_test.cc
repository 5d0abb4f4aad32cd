// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/world/wand_trajectory.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace rigcal::wand_trajectory_test {
namespace {

const WaveVolume kVolume{{0.5, -0.5, 1.5}, {2, 2, 1}};

Eigen::Vector3d VelocityAt(const WandTrajectory& trajectory, double t) {
  constexpr double kStep = 1e-4;
  return (trajectory.Middle(t + kStep) - trajectory.Middle(t - kStep)) / (2 * kStep);
}

TEST(WandTrajectory, PeaksAtTheSpeedLimitAndNeverExceedsIt) {
  for (const uint32_t seed : {1u, 2u, 3u, 4u}) {
    for (const double speed : {0.3, 1.5, 6.0}) {
      const WandTrajectory trajectory(seed, kVolume, 60, speed);
      double peak = 0;
      for (double t = 0; t <= 60; t += 1e-3) {
        peak = std::max(peak, VelocityAt(trajectory, t).norm());
      }
      EXPECT_LE(peak, speed) << seed;
      EXPECT_GE(peak, 0.95 * speed) << seed;
    }
  }
}

TEST(WandTrajectory, KeepsTheLimitOverAVeryLongWave) {
  const WandTrajectory trajectory(1, kVolume, 86400, 2);
  double peak = 0;
  for (double t = 0; t <= 86400; t += 0.25) {
    peak = std::max(peak, VelocityAt(trajectory, t).norm());
  }
  EXPECT_LE(peak, 2);
  EXPECT_GE(peak, 1);
}

TEST(WandTrajectory, ChangesOfItsVelocityAreSmooth) {
  const WandTrajectory trajectory(5, kVolume, 60, 1.5);
  constexpr double kStep = 1e-3;
  Eigen::Vector3d last_acceleration = Eigen::Vector3d::Zero();
  for (double t = 0; t < 30; t += kStep) {
    const Eigen::Vector3d acceleration =
        (VelocityAt(trajectory, t + kStep) - VelocityAt(trajectory, t - kStep)) / (2 * kStep);
    // 50 m/s^3 is far above what a smooth wave at 1.5 m/s has and far below any jump.
    if (t > 0) {
      ASSERT_LT((acceleration - last_acceleration).norm(), 50 * kStep);
    }
    last_acceleration = acceleration;
  }
}

TEST(WandTrajectory, StaysInTheVolumeAndFillsIt) {
  for (const uint32_t seed : {1u, 2u, 3u}) {
    const WandTrajectory trajectory(seed, kVolume, 60, 1.5);
    Eigen::Vector3d low = kVolume.centre_m, high = kVolume.centre_m;
    for (double t = 0; t <= 60; t += 0.01) {
      low = low.cwiseMin(trajectory.Middle(t));
      high = high.cwiseMax(trajectory.Middle(t));
    }
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_GE(low[axis], kVolume.centre_m[axis] - kVolume.half_extent_m[axis]);
      EXPECT_LE(high[axis], kVolume.centre_m[axis] + kVolume.half_extent_m[axis]);
      EXPECT_GE(high[axis] - low[axis], 1.2 * kVolume.half_extent_m[axis]) << "axis " << axis;
    }
  }
}

// Spread evenly, each component of the direction would have a mean square of 1/3.
TEST(WandTrajectory, DirectionIsAUnitVectorThatSweepsAllOrientations) {
  for (const uint32_t seed : {1u, 2u, 3u}) {
    const WandTrajectory trajectory(seed, kVolume, 60, 1.5);
    Eigen::Vector3d mean_square = Eigen::Vector3d::Zero();
    Eigen::Vector3d largest = Eigen::Vector3d::Zero();
    int count = 0;
    for (double t = 0; t <= 60; t += 0.02, ++count) {
      const Eigen::Vector3d direction = trajectory.Direction(t);
      ASSERT_NEAR(direction.norm(), 1, 1e-12);
      mean_square += direction.cwiseAbs2();
      largest = largest.cwiseMax(direction.cwiseAbs());
    }
    mean_square /= count;
    EXPECT_GT(mean_square.minCoeff(), 0.1) << mean_square.transpose();
    EXPECT_GT(largest.minCoeff(), 0.9) << largest.transpose();
  }
}

TEST(WandTrajectory, DiffersBySeed) {
  const WandTrajectory a(1, kVolume, 60, 1.5), b(2, kVolume, 60, 1.5);
  EXPECT_GT((a.Middle(3) - b.Middle(3)).norm(), 1e-3);
}

}  // namespace
}  // namespace rigcal::wand_trajectory_test
