// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/motion_spectrum.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/server/solve/clocks/synthetic_paths.h"

namespace rigcal::server::motion_spectrum_test {
namespace {

constexpr double kStepS = 0.02;

LagScores Score(const TrackPaths& a, const TrackPaths& b, int min_matches) {
  const int size = FftSizeFor(2 * std::max(GridSamples(a, kStepS), GridSamples(b, kStepS)));
  return ScoreAllLags(SpectrumOf(a, kStepS, size), SpectrumOf(b, kStepS, size), min_matches);
}

size_t LowestLag(const LagScores& scores) {
  return static_cast<size_t>(std::ranges::min_element(scores.rms_px) - scores.rms_px.begin());
}

TEST(FftSizeFor, IsEvenAndAProductOfSmallPrimes) {
  EXPECT_EQ(FftSizeFor(1), 2);
  EXPECT_EQ(FftSizeFor(7), 8);
  EXPECT_EQ(FftSizeFor(15), 16);
  EXPECT_EQ(FftSizeFor(1001), 1024);
  EXPECT_EQ(FftSizeFor(8193), 8640);
}

// Stamps in a wrong unit may span years.
TEST(GridStepS, BecomesCoarserForLongRecordingsUntilMemoryEnds) {
  EXPECT_EQ(GridStepS(90, 0.02), 0.02);
  EXPECT_EQ(GridStepS(3600, 0.02), 0.04);
  EXPECT_EQ(GridStepS(1e9, 0.02), std::nullopt);
  EXPECT_EQ(GridStepS(0, 0.02), 0.02);
}

// Up to half a step of the grid and the offset of the tracks' first rows are left.
TEST(ScoreAllLags, IsLowestAtTheOffsetOfTwoViewsOfOneMotion) {
  for (const double offset_s : {0.0, 7.31, -23.4}) {
    for (const size_t markers : {size_t{1}, size_t{3}}) {
      const TrackPaths a = SyntheticPaths({.view = 0, .markers = markers});
      const TrackPaths b = SyntheticPaths({.view = 1, .markers = markers, .offset_s = offset_s});
      const LagScores scores = Score(a, b, 500);
      const size_t lowest = LowestLag(scores);
      EXPECT_NEAR(scores.OffsetS(lowest), offset_s, kStepS) << markers;
      EXPECT_LT(scores.rms_px[lowest], 4);
      const auto far = static_cast<size_t>(1 / kStepS);
      EXPECT_GT(scores.rms_px[lowest + far], 5 * scores.rms_px[lowest]);
      EXPECT_GT(scores.rms_px[lowest - far], 5 * scores.rms_px[lowest]);
    }
  }
}

// By the definition: the grid's samples at which both are seen.
TEST(ScoreAllLags, CountsWhatBothSaw) {
  const TrackPaths a = SyntheticPaths({.view = 0, .duration_s = 10});
  const TrackPaths b = SyntheticPaths({.view = 1, .duration_s = 4, .offset_s = 3});
  const LagScores scores = Score(a, b, 40);
  ASSERT_EQ(scores.rms_px.size(),
            static_cast<size_t>(GridSamples(a, kStepS) + GridSamples(b, kStepS) - 1));
  for (size_t lag = 0; lag < scores.rms_px.size(); ++lag) {
    int expected = 0;
    for (size_t m = 0; m < a.markers.size(); ++m) {
      for (int i = 0; i < GridSamples(a, kStepS); ++i) {
        const double time_s = a.markers[0].time_s.front() + kStepS * i;
        const double there_s = time_s - scores.OffsetS(lag);
        const double last_s = b.markers[0].time_s.front() + kStepS * GridSamples(b, kStepS);
        // Not where rounding decides whether the last sample is in it.
        if (there_s > last_s - 0.5 * kStepS) continue;
        expected += At(a.markers[m], time_s, a.gap_s) && At(b.markers[m], there_s, b.gap_s) ? 1 : 0;
      }
    }
    EXPECT_NEAR(scores.matches[lag], expected, 12) << scores.OffsetS(lag);
    EXPECT_EQ(std::isinf(scores.rms_px[lag]), scores.matches[lag] < 40) << lag;
  }
}

TEST(ScoreAllLags, OfAnEmptyTrackHasNoScores) {
  const TrackPaths a = SyntheticPaths({.view = 0});
  TrackPaths empty = a;
  for (RayPath& path : empty.markers) path = {};
  EXPECT_EQ(GridSamples(empty, kStepS), 0);
  EXPECT_TRUE(Score(a, empty, 40).rms_px.empty());
}

TEST(DistanceFromItself, IsTheRootMeanSquareOfTheWayMade) {
  const TrackPaths a = SyntheticPaths({.view = 0, .markers = 1, .duration_s = 20, .noise_px = 0});
  const MotionSpectrum spectrum = SpectrumOf(a, kStepS, FftSizeFor(2 * GridSamples(a, kStepS)));
  const LagScores distances = DistanceFromItself(spectrum, 40);
  EXPECT_NEAR(distances.rms_px[0], 0, 0.01);
  for (const size_t lag : {size_t{10}, size_t{150}, size_t{500}}) {
    double squares = 0, count = 0;
    const double first_s = a.markers[0].time_s.front();
    for (size_t i = lag; i < static_cast<size_t>(GridSamples(a, kStepS)); ++i) {
      const auto here = At(a.markers[0], first_s + kStepS * static_cast<double>(i), a.gap_s);
      const auto there = At(a.markers[0], first_s + kStepS * static_cast<double>(i - lag), a.gap_s);
      if (!here || !there) continue;
      squares += (*here - *there).squaredNorm();
      ++count;
    }
    EXPECT_EQ(distances.matches[lag], static_cast<int>(count));
    EXPECT_NEAR(distances.rms_px[lag], a.focal_px * std::sqrt(squares / count), 0.01);
  }
}

}  // namespace
}  // namespace rigcal::server::motion_spectrum_test
