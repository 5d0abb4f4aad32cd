// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/error_figures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/server/solve/exact_problem.h"

namespace rigcal::server::error_figures_test {
namespace {

TEST(Figures, OfNothingAreZeros) {
  const ErrorFigures figures = Figures({});
  EXPECT_EQ(figures.mean_px, 0);
  EXPECT_EQ(figures.rms_px, 0);
  EXPECT_EQ(figures.median_px, 0);
  EXPECT_EQ(figures.p95_px, 0);
  EXPECT_EQ(figures.marker_count, 0u);
}

TEST(Figures, OfOneValueAreThatValue) {
  const ErrorFigures figures = Figures({0.75});
  EXPECT_EQ(figures.mean_px, 0.75);
  EXPECT_EQ(figures.rms_px, 0.75);
  EXPECT_EQ(figures.median_px, 0.75);
  EXPECT_EQ(figures.p95_px, 0.75);
  EXPECT_EQ(figures.marker_count, 1u);
}

TEST(Figures, OfTwoValuesLieBetweenThem) {
  const ErrorFigures figures = Figures({7, 1});
  EXPECT_DOUBLE_EQ(figures.mean_px, 4);
  EXPECT_DOUBLE_EQ(figures.rms_px, 5);
  EXPECT_DOUBLE_EQ(figures.median_px, 4);
  EXPECT_DOUBLE_EQ(figures.p95_px, 1 + 0.95 * 6);
  EXPECT_EQ(figures.marker_count, 2u);
}

TEST(Figures, OfThreeValuesHaveTheMiddleOneAsMedian) {
  const ErrorFigures figures = Figures({10, 1, 2});
  EXPECT_DOUBLE_EQ(figures.mean_px, 13.0 / 3);
  EXPECT_DOUBLE_EQ(figures.rms_px, std::sqrt(105.0 / 3));
  EXPECT_EQ(figures.median_px, 2);
  EXPECT_DOUBLE_EQ(figures.p95_px, 2 + 0.9 * 8);
}

TEST(Figures, OfACountThatMeetsThe95thPercentileAreAValueOfTheSet) {
  std::vector<double> errors_px;
  for (int i = 0; i <= 100; ++i) errors_px.push_back(100 - i);
  EXPECT_DOUBLE_EQ(Figures(errors_px).p95_px, 95);
  EXPECT_DOUBLE_EQ(Figures(errors_px).median_px, 50);
}

TEST(Figures, DependOnTheSetAlone) {
  std::mt19937 random(7);
  std::vector<double> errors_px;
  for (int i = 0; i < 999; ++i) {
    errors_px.push_back(std::exp(std::normal_distribution<double>(0, 3)(random)));
  }
  const ErrorFigures first = Figures(errors_px);
  for (int round = 0; round < 5; ++round) {
    std::shuffle(errors_px.begin(), errors_px.end(), random);
    const ErrorFigures again = Figures(errors_px);
    EXPECT_EQ(first.mean_px, again.mean_px);
    EXPECT_EQ(first.rms_px, again.rms_px);
  }
}

TEST(ComputeResiduals, CountsOutliersInAllButNotAmongInliers) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {{{0, 0, 4}}, {{0.2, 0.1, 5}}});
  problem.markers[0].centre_px += Eigen::Vector2d(0.3, 0.4);  // camera 0, 0.5 px off
  problem.markers[1].centre_px += Eigen::Vector2d(30, 40);    // camera 0, an outlier
  problem.markers[1].used = false;
  const std::vector<Residuals> residuals = ComputeResiduals(problem);
  ASSERT_EQ(residuals.size(), 2u);
  EXPECT_EQ(residuals[0].observation_count, 2u);
  EXPECT_EQ(residuals[0].outlier_count, 1u);
  EXPECT_EQ(residuals[0].all.marker_count, 6u);
  EXPECT_NEAR(residuals[0].all.mean_px, 50.5 / 6, 1e-9);
  EXPECT_EQ(residuals[0].inlier.marker_count, 5u);
  EXPECT_NEAR(residuals[0].inlier.mean_px, 0.1, 1e-9);
  EXPECT_EQ(residuals[1].outlier_count, 0u);
  EXPECT_NEAR(residuals[1].all.p95_px, 0, 1e-9);
}

TEST(ComputeResiduals, LeavesOutInstantsThatAreNotPlaced) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {{{0, 0, 4}}, {{0, 0, 5}}});
  problem.instants[1].used = false;
  problem.instants[1].origin_m += Eigen::Vector3d(1, 1, 1);
  const std::vector<Residuals> residuals = ComputeResiduals(problem);
  EXPECT_EQ(residuals[0].observation_count, 1u);
  EXPECT_EQ(residuals[0].all.marker_count, 3u);
  EXPECT_NEAR(residuals[0].all.mean_px, 0, 1e-9);
}

TEST(ComputeResiduals, CountsAMarkerBehindItsCameraWithoutAnError) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {0, 0, 10}}, {{{0, 0, 4}}});
  for (size_t m = 3; m < 6; ++m) problem.markers[m].used = false;  // behind camera 1
  const std::vector<Residuals> residuals = ComputeResiduals(problem);
  EXPECT_EQ(residuals[1].observation_count, 1u);
  EXPECT_EQ(residuals[1].outlier_count, 3u);
  EXPECT_EQ(residuals[1].all.marker_count, 0u);
  EXPECT_EQ(residuals[1].inlier.marker_count, 0u);
}

TEST(ComputeResiduals, TakesTheClockIntoAccount) {
  BundleProblem problem = ExactProblem({{0, 0, 0}}, {{{0, 0, 4}}});
  problem.clocks[0].time_offset_s = 0.01;
  problem.clocks[0].time_rate = 0.001;
  problem.observations[0].clock_time_s = 10;  // dt = 0.02 s
  for (BundleMarker& marker : problem.markers) {
    marker.velocity_px_s = {100, -50};
    marker.centre_px += Eigen::Vector2d(2, -1);
  }
  EXPECT_NEAR(ComputeResiduals(problem)[0].all.p95_px, 0, 1e-9);
}

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
}  // namespace rigcal::server::error_figures_test
