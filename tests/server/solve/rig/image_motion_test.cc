// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/image_motion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/simulation/world/random_stream.h"
#include "tests/server/associate/edit_rows.h"
#include "tests/server/solve/rig/track_of_path.h"

namespace rigcal::server::image_motion_test {
namespace {

Eigen::Vector2d PathAt(double t) {
  return {300 + 200 * std::sin(4 * t), 250 + 150 * std::cos(3 * t)};
}
Eigen::Vector2d VelocityAt(double t) { return {800 * std::cos(4 * t), -450 * std::sin(3 * t)}; }

AlignedTrack Track(int rows, double period_s) { return TrackOfPath(PathAt, rows, period_s, 0.5); }

TEST(ImageMotion, FollowsASmoothPath) {
  const AlignedTrack track = Track(40, 0.05);
  const ImageMotion motion(track, 1);
  for (const double shift_s : {-0.02, -0.008, 0.0, 0.01, 0.025}) {
    const MarkerMotion at = motion.At(20, 0, shift_s);
    EXPECT_LT((at.centre_px - PathAt(1.0 + shift_s)).norm(), 0.02) << shift_s;
    EXPECT_LT((at.velocity_px_s - VelocityAt(1.0 + shift_s)).norm(), 5) << shift_s;
  }
}

TEST(ImageMotion, WithoutAShiftTheRowStaysAsItIs) {
  const AlignedTrack track = Track(10, 0.1);
  const ImageMotion motion(track, 1);
  for (const int row : {0, 1, 5, 9}) {
    const MarkerMotion at = motion.At(row, 0, 0);
    EXPECT_LT((at.centre_px - PathAt(0.1 * row)).norm(), 1e-9);
    EXPECT_NEAR(at.covariance_px2(0, 0), 0.25, 1e-6);
  }
}

TEST(ImageMotion, AWildNeighbourDoesNotMoveIt) {
  AlignedTrack track = Track(40, 0.05);
  EditRow(&track, 21,
          [](Observation& row) { row.markers[0].centre_px += Eigen::Vector2d(300, -200); });
  const ImageMotion motion(track, 1);
  const MarkerMotion at = motion.At(20, 0, 0.02);
  EXPECT_LT((at.centre_px - PathAt(1.02)).norm(), 0.5);
  // The outlier stays one, and does not become uncertain instead.
  const MarkerMotion outlier = motion.At(21, 0, 0.01);
  EXPECT_GT((outlier.centre_px - PathAt(1.06)).norm(), 300);
  EXPECT_LT(outlier.covariance_px2(0, 0), 1.0);
}

TEST(ImageMotion, ALoneRowIsOnlyAsCertainAsItsSpeedAllows) {
  AlignedTrack track = Track(30, 0.05);
  for (const int row : {17, 18, 19, 21, 22, 23, 24, 16}) {
    EditRow(&track, static_cast<size_t>(row),
            [](Observation& observation) { observation.markers[0].visible = false; });
  }
  const ImageMotion motion(track, 1);
  const MarkerMotion at = motion.At(20, 0, 0.01);
  EXPECT_TRUE(at.velocity_px_s.isZero());
  EXPECT_GT(at.covariance_px2(0, 0), 10);
  EXPECT_GT(motion.typical_speed_px_s(), 100);
}

TEST(ImageMotion, MarkersWithTimesOfTheirOwnAreTakenAtThose) {
  AlignedTrack track = Track(40, 0.05);
  EditRows(&track, [](std::vector<Observation>& rows) {
    for (Observation& row : rows) {
      row.markers[0].time_delta_ns = 5'000'000;
      row.markers[0].centre_px = PathAt(1e-9 * static_cast<double>(row.time_ns) + 0.005);
    }
  });
  const ImageMotion motion(track, 1);
  EXPECT_LT((motion.At(20, 0, 0.01).centre_px - PathAt(1.015)).norm(), 0.02);
}

TEST(ImageMotion, NeighboursUncertaintyIsAccountedFor) {
  const AlignedTrack track = Track(40, 0.05);
  const ImageMotion motion(track, 1);
  const double here = motion.At(20, 0, 0).covariance_px2(0, 0);
  const double between = motion.At(20, 0, 0.02).covariance_px2(0, 0);
  EXPECT_NE(here, between);
  EXPECT_GT(between, 0.1);
  EXPECT_LT(between, 0.5);
}

// A row's noise of its own, by row and time step, without a path.
AlignedTrack Noise(int rows, double period_s, uint64_t seed) {
  AlignedTrack track = Track(rows, period_s);
  RandomStream random{seed};
  EditRows(&track, [&random](std::vector<Observation>& all) {
    for (Observation& row : all) {
      const double x = random.Gaussian(), y = random.Gaussian();
      row.markers[0].centre_px = 0.5 * Eigen::Vector2d(x, y);
    }
  });
  return track;
}

// Between the rows each centre is a mean of several, but a run of them is worth as much as its
// rows.
TEST(ImageMotion, RowsInterpolatedInARowAreWorthAsMuchAsTheRows) {
  constexpr int kRuns = 400, kRows = 30;
  double square = 0, mean_square = 0, stated = 0, share = 0;
  for (int run = 0; run < kRuns; ++run) {
    const AlignedTrack track = Noise(kRows + 20, 0.02, static_cast<uint64_t>(run));
    const ImageMotion motion(track, 1);
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (int i = 10; i < 10 + kRows; ++i) {
      const MarkerMotion at = motion.At(i, 0, 0.0099);
      mean += at.centre_px / kRows;
      square += at.centre_px.squaredNorm() / (2 * kRuns * kRows);
      share += at.noise_share / (kRuns * kRows);
    }
    mean_square += kRows * mean.squaredNorm() / (2 * kRuns);
    stated = motion.At(20, 0, 0.0099).covariance_px2(0, 0);
  }
  // 3 sigma of 800 squares are 15 %. What the fit leaves out is stated on top.
  EXPECT_NEAR(mean_square, 0.25, 0.04);
  EXPECT_GT(stated, 0.25 - 1e-9);
  EXPECT_LT(stated, 0.35);
  EXPECT_LT(square, 0.8 * 0.25);
  EXPECT_NEAR(share * 0.25, square, 0.01);
}

// Else the product of the two, which the time offset follows, has a mean.
TEST(ImageMotion, TheVelocityHasNoneOfTheCentresNoise) {
  for (const double period_s : {1.0 / 120, 1.0 / 50}) {
    for (const double share : {-0.45, 0.2, 0.45}) {
      double product = 0, centre = 0, velocity = 0;
      for (int run = 0; run < 4000; ++run) {
        const AlignedTrack track = Noise(20, period_s, static_cast<uint64_t>(run));
        const ImageMotion motion(track, 1);
        const MarkerMotion at = motion.At(10, 0, share * period_s);
        product += at.centre_px.dot(at.velocity_px_s);
        centre += at.centre_px.squaredNorm();
        velocity += at.velocity_px_s.squaredNorm();
      }
      // 4.5 sigma of 8000 products.
      EXPECT_LT(std::abs(product), 0.05 * std::sqrt(centre * velocity)) << period_s << " " << share;
    }
  }
}

// More patterns of missing rows than are remembered, at several shifts.
TEST(MotionWeightsMemory, ChangesNoBit) {
  AlignedTrack track = Track(400, 0.02);
  for (size_t row = 0; row < 400; ++row) {
    if (row * row % 7 != 3 && row % 11 != 5) continue;
    EditRow(&track, row, [](Observation& observation) { observation.markers[0].visible = false; });
  }
  const ImageMotion motion(track, 1);
  MotionWeightsMemory memory;
  for (int row = 0; row < 400; ++row) {
    if (!track.track.observations.IsVisible(static_cast<size_t>(row), 0)) continue;
    const double shift_s = 1e-4 * (row % 5);
    const MarkerMotion with = motion.At(row, 0, shift_s, &memory);
    const MarkerMotion without = motion.At(row, 0, shift_s);
    ASSERT_EQ(with.centre_px, without.centre_px) << row;
    ASSERT_EQ(with.velocity_px_s, without.velocity_px_s) << row;
    ASSERT_EQ(with.covariance_px2, without.covariance_px2) << row;
  }
}

}  // namespace
}  // namespace rigcal::server::image_motion_test
