// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/residual_vectors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "tests/server/solve/exact_problem.h"

namespace rigcal::server::residual_vectors_test {
namespace {

using ::testing::SizeIs;

size_t Sum(const std::vector<uint32_t>& counts) {
  return std::accumulate(counts.begin(), counts.end(), size_t{0});
}

BundleProblem TwoCamerasAndManyInstants(int count) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {{{0, 0, 4}}, {{0.2, 0.1, 5}}});
  const BundleProblem once = problem;
  for (int i = 1; i < count; ++i) {
    for (BundleInstant instant : once.instants) {
      instant.first_observation += static_cast<int>(problem.observations.size());
      problem.instants.push_back(instant);
    }
    const int first_marker = static_cast<int>(problem.markers.size());
    for (BundleObservation observation : once.observations) {
      observation.first_marker += first_marker;
      problem.observations.push_back(observation);
    }
    problem.markers.insert(problem.markers.end(), once.markers.begin(), once.markers.end());
  }
  return problem;
}

TEST(CollectResiduals, AreProjectedMinusMeasured) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {{{0, 0, 4}}, {{0.2, 0.1, 5}}});
  problem.markers[0].centre_px += Eigen::Vector2d(0.3, 0.4);
  problem.markers[1].centre_px += Eigen::Vector2d(30, 40);
  problem.markers[1].used = false;
  const std::vector<CameraResiduals> residuals = CollectResiduals(problem);
  ASSERT_THAT(residuals, SizeIs(2));
  EXPECT_EQ(residuals[0].camera, problem.cameras[0].name);
  ASSERT_THAT(residuals[0].vectors, SizeIs(6));
  const CameraResiduals::Vector& first = residuals[0].vectors.front();
  EXPECT_NEAR(first.x_px, problem.markers[0].centre_px.x(), 0.006);
  EXPECT_NEAR(first.dx_px, -0.3, 0.001);
  EXPECT_NEAR(first.dy_px, -0.4, 0.001);
  EXPECT_FALSE(first.outlier);
  const CameraResiduals::Vector& last = residuals[0].vectors.back();
  EXPECT_TRUE(last.outlier) << "what was left out comes last";
  EXPECT_NEAR(std::hypot(last.dx_px, last.dy_px), 50, 0.01);
  EXPECT_EQ(Sum(residuals[0].inlier_counts), 5u);
  EXPECT_EQ(Sum(residuals[0].outlier_counts), 1u);
  EXPECT_EQ(residuals[0].outlier_counts.back(), 1u) << "beyond the end is in the last bin";
  EXPECT_EQ(residuals[0].inlier_counts.size(), residuals[0].outlier_counts.size());
  EXPECT_EQ(Sum(residuals[1].outlier_counts), 0u);
}

TEST(CollectResiduals, LeavesOutInstantsThatAreNotPlaced) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {{{0, 0, 4}}, {{0, 0, 5}}});
  problem.instants[1].used = false;
  EXPECT_THAT(CollectResiduals(problem)[0].vectors, SizeIs(3));
}

TEST(CollectResiduals, ThinsVectorsButCountsAll) {
  const BundleProblem problem = TwoCamerasAndManyInstants(50);
  const ResidualVectorLimits limits = {.inliers_per_camera = 20, .outliers_per_camera = 5};
  const std::vector<CameraResiduals> thinned = CollectResiduals(problem, limits);
  EXPECT_THAT(thinned[0].vectors, SizeIs(20));
  EXPECT_EQ(Sum(thinned[0].inlier_counts), 300u);
  const std::vector<CameraResiduals> bounded =
      CollectResiduals(problem, {.inliers_per_camera = 20, .outliers_per_camera = 5, .total = 10});
  EXPECT_LE(bounded[0].vectors.size() + bounded[1].vectors.size(), 10u);
  EXPECT_GT(bounded[0].vectors.size(), 0u);
}

TEST(CollectResiduals, BinsHoldNearlyAllInliers) {
  BundleProblem problem = TwoCamerasAndManyInstants(50);
  for (size_t m = 0; m < problem.markers.size(); ++m) {
    problem.markers[m].centre_px.x() += 0.01 * static_cast<double>(m % 100);
  }
  const CameraResiduals residuals = CollectResiduals(problem)[0];
  EXPECT_GT(residuals.bin_px * static_cast<double>(residuals.inlier_counts.size()), 0.97);
  EXPECT_LT(residuals.bin_px, 0.2);
  EXPECT_LE(residuals.inlier_counts.back(), 3u);
}

TEST(CollectResiduals, CountsNoMarkerBehindItsCamera) {
  const BundleProblem problem = ExactProblem({{0, 0, 0}, {0, 0, 10}}, {{{0, 0, 4}}});
  EXPECT_THAT(CollectResiduals(problem)[1].vectors, SizeIs(0));
}

}  // namespace
}  // namespace rigcal::server::residual_vectors_test
