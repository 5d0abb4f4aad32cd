// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/outliers.h"

#include <gtest/gtest.h>

#include "tests/server/solve/exact_problem.h"

namespace rigcal::server::outliers_test {
namespace {

// Markers of camera c of ExactProblem with two cameras, instant i.
size_t First(size_t instant, size_t camera) { return 6 * instant + 3 * camera; }

BundleProblem Two(int instants) {
  std::vector<ExactWand> wands;
  for (int i = 0; i < instants; ++i) wands.push_back({{0.1 * i, 0, 4}});
  return ExactProblem({{0, 0, 0}, {1, 0, 0}}, wands);
}

void Shift(size_t camera, double shift_px, BundleProblem* problem) {
  for (size_t i = 0; i < problem->instants.size(); ++i) {
    for (size_t m = 0; m < 3; ++m) {
      problem->markers[First(i, camera) + m].centre_px.x() += shift_px;
    }
  }
}

TEST(OutlierLimits, AreTheMedianOverThatOfANormalVectorAndNeverBelowTheLeast) {
  BundleProblem problem = Two(3);
  Shift(1, 11.7741, &problem);
  const std::vector<double> limits = OutlierLimits(problem);
  ASSERT_EQ(limits.size(), 2u);
  EXPECT_EQ(limits[0], 8);
  EXPECT_NEAR(limits[1], 80, 1e-5);
}

TEST(OutlierLimits, OfACameraWithoutMarkersAreTheLeast) {
  BundleProblem problem = Two(1);
  problem.instants[0].used = false;
  EXPECT_EQ(OutlierLimits(problem), (std::vector<double>{8, 8}));
  EXPECT_EQ(OutlierLimits({}), std::vector<double>());
}

TEST(OutlierLimits, AreOfWhitenedResiduals) {
  BundleProblem problem = Two(3);
  Shift(1, 11.7741, &problem);
  for (BundleMarker& marker : problem.markers) marker.sqrt_information *= 0.5;
  EXPECT_NEAR(OutlierLimits(problem)[1], 40, 1e-5);
}

TEST(ClassifyOutliers, TurnsAtTheStatedMultipleOfTheScale) {
  BundleProblem problem = Two(4);
  problem.markers[First(0, 0)].centre_px.x() += 7.99;
  problem.markers[First(1, 0)].centre_px.y() -= 8.01;
  EXPECT_EQ(ClassifyOutliers(&problem), 1);
  for (size_t m = 0; m < problem.markers.size(); ++m) {
    EXPECT_EQ(problem.markers[m].used, m != First(1, 0)) << m;
  }
  EXPECT_EQ(ClassifyOutliers(&problem), 0);
}

TEST(ClassifyOutliers, TakesBackWhatFitsAgain) {
  BundleProblem problem = Two(4);
  problem.markers[5].used = false;
  EXPECT_EQ(ClassifyOutliers(&problem), 1);
  EXPECT_TRUE(problem.markers[5].used);
}

TEST(ClassifyOutliers, KeepsTheMarkersOfACameraThatIsOffAsAWhole) {
  BundleProblem problem = Two(4);
  Shift(1, 40, &problem);
  EXPECT_EQ(ClassifyOutliers(&problem), 0);
  // The other camera's rule stays strict.
  problem.markers[First(2, 0)].centre_px.x() += 40;
  EXPECT_EQ(ClassifyOutliers(&problem), 1);
}

TEST(ClassifyOutliers, AMarkerBehindItsCameraIsOne) {
  BundleProblem problem = Two(5);
  problem.instants[3].origin_m.z() = -1;
  EXPECT_GE(ClassifyOutliers(&problem), 6);
  for (size_t m = 0; m < problem.markers.size(); ++m) {
    EXPECT_EQ(problem.markers[m].used, m / 6 != 3) << m;
  }
}

TEST(ClassifyOutliers, LeavesInstantsAloneThatAreNotPlaced) {
  BundleProblem problem = Two(4);
  problem.instants[1].used = false;
  problem.markers[First(1, 0)].centre_px.x() += 500;
  problem.markers[First(1, 1)].used = false;
  EXPECT_EQ(ClassifyOutliers(&problem), 0);
  EXPECT_TRUE(problem.markers[First(1, 0)].used);
  EXPECT_FALSE(problem.markers[First(1, 1)].used);
}

}  // namespace
}  // namespace rigcal::server::outliers_test
