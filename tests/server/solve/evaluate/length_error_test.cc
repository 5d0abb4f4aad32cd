// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/length_error.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/server/solve/exact_problem.h"

namespace rigcal::server::length_error_test {
namespace {

const std::vector<double> kPositions_m = {0, 0.13, 0.39};

BundleProblem Three(const std::vector<ExactWand>& wands) {
  return ExactProblem({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, wands);
}

TEST(MeasureLengths, OfExactViewsAreZero) {
  const LengthErrors errors =
      MeasureLengths(Three({{{0, 0, 4}}, {{0.3, 0.1, 5}, {0, 1, 1}}}), kPositions_m, 3);
  ASSERT_EQ(errors.size(), 2u);
  for (const std::vector<double>& span : errors) {
    ASSERT_EQ(span.size(), 2u);
    for (const double error_m : span) EXPECT_NEAR(error_m, 0, 1e-9);
  }
}

TEST(MeasureLengths, AreTriangulatedMinusExpected) {
  const LengthErrors errors = MeasureLengths(Three({{{0, 0, 4}}}), {0, 0.12, 0.40}, 2);
  EXPECT_NEAR(errors[0][0], 0.01, 1e-9);
  EXPECT_NEAR(errors[1][0], -0.02, 1e-9);
}

TEST(MeasureLengths, DoNotUseTheWandConstraint) {
  BundleProblem problem = Three({{{0, 0, 4}}});
  // Where the target is said to be does not matter.
  problem.instants[0].origin_m = {1, 2, 3};
  problem.target.marker_positions_m = {0, 1, 2};
  EXPECT_NEAR(MeasureLengths(problem, kPositions_m, 3)[1][0], 0, 1e-9);
}

TEST(MeasureLengths, NeedTheAskedNumberOfCamerasForBothEnds) {
  BundleProblem problem = Three({{{0, 0, 4}}});
  problem.markers[1].used = false;  // marker 1 is left with two cameras
  const LengthErrors three = MeasureLengths(problem, kPositions_m, 3);
  EXPECT_TRUE(three[0].empty());
  EXPECT_TRUE(three[1].empty());
  const LengthErrors two = MeasureLengths(problem, kPositions_m, 2);
  EXPECT_EQ(two[0].size(), 1u);
  EXPECT_EQ(two[1].size(), 1u);
}

TEST(MeasureLengths, LeaveOutInstantsNotPlaced) {
  BundleProblem problem = Three({{{0, 0, 4}}, {{0, 0, 5}}, {{0, 0, 6}}});
  problem.instants[0].used = false;
  EXPECT_EQ(MeasureLengths(problem, kPositions_m, 3)[0].size(), 2u);
}

TEST(MeasureLengths, TakeTheClockIntoAccount) {
  BundleProblem problem = Three({{{0, 0, 4}}});
  problem.clocks.resize(2);
  problem.observations[1].clock = 1;
  problem.clocks[1].time_offset_s = 0.01;
  for (size_t m = 3; m < 6; ++m) {
    problem.markers[m].velocity_px_s = {500 * static_cast<double>(m), 300};
    problem.markers[m].centre_px += 0.01 * problem.markers[m].velocity_px_s;
  }
  EXPECT_NEAR(MeasureLengths(problem, kPositions_m, 3)[0][0], 0, 1e-9);
}

TEST(MeasureLengths, OfNothingAreNone) {
  EXPECT_TRUE(MeasureLengths(Three({}), {}, 3).empty());
  EXPECT_TRUE(MeasureLengths(Three({}), {0}, 3).empty());
  const LengthErrors errors = MeasureLengths(Three({}), kPositions_m, 3);
  EXPECT_EQ(errors.size(), 2u);
  EXPECT_EQ(OverallRms(errors), 0);
  EXPECT_EQ(OverallRms({}), 0);
}

TEST(SummariseSpans, GivesMeanAndRootMeanSquareOfEach) {
  const LengthErrors errors = {{0.001, 0.003}, {}};
  const std::vector<SpanError> spans = SummariseSpans(errors, kPositions_m);
  ASSERT_EQ(spans.size(), 2u);
  EXPECT_DOUBLE_EQ(spans[0].length_m, 0.13);
  EXPECT_DOUBLE_EQ(spans[1].length_m, 0.26);
  EXPECT_DOUBLE_EQ(spans[0].mean_error_m, 0.002);
  EXPECT_DOUBLE_EQ(spans[0].error_rms_m, std::sqrt(5e-6));
  EXPECT_EQ(spans[0].count, 2u);
  EXPECT_EQ(spans[1].count, 0u);
  EXPECT_EQ(spans[1].mean_error_m, 0);
  EXPECT_EQ(spans[1].error_rms_m, 0);
}

TEST(OverallRms, WeighsEveryErrorTheSame) {
  EXPECT_DOUBLE_EQ(OverallRms({{-0.003}, {0.001, 0.001}}), std::sqrt(11e-6 / 3));
}

}  // namespace
}  // namespace rigcal::server::length_error_test
