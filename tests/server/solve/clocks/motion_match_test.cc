// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/motion_match.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/solve/clocks/motion_period.h"
#include "tests/server/solve/clocks/synthetic_paths.h"

namespace rigcal::server::motion_match_test {
namespace {

constexpr double kStepS = 0.02;

MotionMatch Match(const TrackPaths& a, const TrackPaths& b) {
  const int size = FftSizeFor(2 * std::max(GridSamples(a, kStepS), GridSamples(b, kStepS)));
  return MatchMotion(a, b, SpectrumOf(a, kStepS, size), SpectrumOf(b, kStepS, size));
}

TEST(MatchMotion, FindsTheOffsetWhereverItIs) {
  for (const double offset_s : {-41.7, -1.5, 0.004, 3.0, 30.0}) {
    for (const size_t markers : {size_t{1}, size_t{3}}) {
      const MotionMatch match = Match(
          SyntheticPaths({.view = 0, .markers = markers}),
          SyntheticPaths({.view = 1, .markers = markers, .rate_hz = 24, .offset_s = offset_s}));
      ASSERT_EQ(match.verdict, MotionVerdict::kFound) << offset_s << ", " << markers;
      EXPECT_NEAR(match.peaks.front().offset_s, offset_s, 0.002);
      EXPECT_LT(match.peaks.front().score_px, 0.6);
    }
  }
}

TEST(MatchMotion, FindsItWhereTheRecordingsOverlapForHalfOnly) {
  const MotionMatch match =
      Match(SyntheticPaths({.view = 0, .duration_s = 60}),
            SyntheticPaths({.view = 1, .duration_s = 60, .start_s = 30, .offset_s = 100}));
  ASSERT_EQ(match.verdict, MotionVerdict::kFound);
  EXPECT_NEAR(match.peaks.front().offset_s, 100, 0.002);
}

// A board has many points, of which a few have a path.
TEST(MatchMotion, PointsWithoutAPathNeedNoOverlap) {
  TrackPaths a = SyntheticPaths({.view = 0, .duration_s = 20});
  TrackPaths b = SyntheticPaths({.view = 1, .duration_s = 20, .offset_s = 3});
  a.markers.resize(54);
  b.markers.resize(54);
  const MotionMatch match = Match(a, b);
  ASSERT_EQ(match.verdict, MotionVerdict::kFound);
  EXPECT_NEAR(match.peaks.front().offset_s, 3, 0.002);
}

TEST(MatchMotion, OfTwoMotionsFindsNothing) {
  for (uint32_t seed = 2; seed < 8; ++seed) {
    const MotionMatch match =
        Match(SyntheticPaths({.view = 0}), SyntheticPaths({.view = 1, .seed = seed}));
    EXPECT_EQ(match.verdict, MotionVerdict::kNone) << seed;
  }
}

TEST(MatchMotion, AMotionThatRepeatsItselfIsAmbiguous) {
  for (const double period_s : {1.0, 0.73, 4.1}) {
    const MotionMatch match =
        Match(SyntheticPaths({.view = 0, .period_s = period_s}),
              SyntheticPaths({.view = 1, .offset_s = 3.25, .period_s = period_s}));
    ASSERT_EQ(match.verdict, MotionVerdict::kAmbiguous) << period_s;
    ASSERT_GE(match.peaks.size(), 2u);
    for (const MotionPeak& peak : match.peaks) {
      const double periods = (peak.offset_s - 3.25) / period_s;
      EXPECT_NEAR(periods, std::round(periods), 0.01);
    }
  }
}

TEST(FindMotionPeriod, IsTheTimeAfterWhichTheMotionRepeatsItself) {
  for (const double period_s : {1.0, 0.73, 4.1}) {
    const auto found = FindMotionPeriod(SyntheticPaths({.view = 0, .period_s = period_s}));
    ASSERT_TRUE(found) << period_s;
    EXPECT_NEAR(*found, period_s, 0.03);
  }
}

TEST(FindMotionPeriod, OfAFreeMotionOrNoneIsNone) {
  for (uint32_t seed = 1; seed < 8; ++seed) {
    EXPECT_FALSE(FindMotionPeriod(SyntheticPaths({.view = 0, .seed = seed}))) << seed;
  }
  TrackPaths still = SyntheticPaths({.view = 0});
  for (RayPath& path : still.markers) std::ranges::fill(path.ray, path.ray.front());
  EXPECT_FALSE(FindMotionPeriod(still));
  for (RayPath& path : still.markers) path = {};
  EXPECT_FALSE(FindMotionPeriod(still));
}

}  // namespace
}  // namespace rigcal::server::motion_match_test
