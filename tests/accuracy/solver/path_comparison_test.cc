// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/path_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::path_comparison_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::_;

constexpr double kNoiseM = 0.05;

Eigen::Vector3d Motion(double time_s) {
  return {10 * std::sin(0.11 * time_s), 8 * std::cos(0.17 * time_s + 1),
          4 * std::sin(0.07 * time_s)};
}

ReferencePath Reference() {
  ReferencePath reference{5, {}};
  for (int i = 0; i < 600; ++i) reference.positions_m.push_back(Motion(0.2 * i));
  return reference;
}

// From 30 s on for 60 s, moved, turned and scaled, on a clock of its own.
std::vector<TimedPosition> Path(double noise_m) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(1, Eigen::Vector3d(1, 2, 2) / 3));
  std::vector<TimedPosition> path;
  for (int i = 0; i < 1000; ++i) {
    const double time_s = 0.06 * i;
    const double along = i % 3 == 0 ? noise_m : -0.5 * noise_m;
    const Eigen::Vector3d seen = Motion(30 + 1.0005 * time_s) + along * Eigen::Vector3d::UnitZ();
    path.push_back({1000 + time_s, 0.02 * (turn * seen) + Eigen::Vector3d(1, 2, 3)});
  }
  return path;
}

TEST(ComparePaths, FindsSimilarityAndTime) {
  ASSERT_OK_AND_ASSIGN(const PathErrors errors, ComparePaths(Path(0), Reference()));
  EXPECT_EQ(errors.count, 1000u);
  EXPECT_NEAR(errors.time_offset_s, 30, 1e-3);
  EXPECT_NEAR(errors.time_scale, 1.0005, 2e-5);
  EXPECT_LT(errors.rms_m, 1e-3);
}

TEST(ComparePaths, MeasuresWhatIsLeft) {
  ASSERT_OK_AND_ASSIGN(const PathErrors errors, ComparePaths(Path(kNoiseM), Reference()));
  EXPECT_NEAR(errors.mean_m, 2.0 / 3 * kNoiseM, 1e-3);
  EXPECT_NEAR(errors.rms_m, std::sqrt(0.5) * kNoiseM, 1e-3);
  EXPECT_NEAR(errors.median_m, 0.5 * kNoiseM, 2e-3);
}

// The path is 0.02 times as long as the reference: only a similarity can undo that.
TEST(ComparePaths, FitsNoScaleUnlessItMay) {
  const PathFreedom rigid = {.length_scale = false, .time_scale = false};
  ASSERT_OK_AND_ASSIGN(const PathErrors shrunk, ComparePaths(Path(0), Reference(), rigid));
  EXPECT_GT(shrunk.mean_m, 1);
  std::vector<TimedPosition> path = Path(0);
  for (TimedPosition& position : path) position.position /= 0.02;
  ASSERT_OK_AND_ASSIGN(const PathErrors longer, ComparePaths(path, Reference(), rigid));
  EXPECT_EQ(longer.time_scale, 1);
  // 0.0005 of 60 s are up to 15 ms from the middle, at 1.7 m/s 26 mm.
  EXPECT_LT(longer.mean_m, 0.026);
  EXPECT_GT(longer.mean_m, 0.002);
  ASSERT_OK_AND_ASSIGN(const PathErrors timed,
                       ComparePaths(path, Reference(), {.length_scale = false}));
  EXPECT_LT(timed.mean_m, 1e-3);
}

TEST(ComparePaths, RefusesWhatCannotBeCompared) {
  ReferencePath shorter = Reference();
  shorter.positions_m.resize(200);
  EXPECT_THAT(ComparePaths(Path(0), shorter), StatusIs(absl::StatusCode::kFailedPrecondition, _));
  EXPECT_THAT(ComparePaths({}, shorter), StatusIs(absl::StatusCode::kFailedPrecondition, _));
}

}  // namespace
}  // namespace rigcal::accuracy::path_comparison_test
