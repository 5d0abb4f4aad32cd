// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/target_pose.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "server/solve/geometry/marker_rays.h"
#include "tests/server/solve/exact_problem.h"

namespace rigcal::server::target_pose_test {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

const ExactWand kWand{{0.2, -0.1, 4}, {0.6, 0.3, 0.5}};

using Fit = std::optional<TargetFit>;

// Fits the first instant, from a pose that says nothing.
Fit FitFirst(const BundleProblem& problem, const std::vector<bool>& has_pose,
             const std::vector<Eigen::Vector2d>& rays) {
  BundleInstant start = problem.instants[0];
  start.origin_m = {9, 9, 9};
  start.direction = Eigen::Vector3d::UnitZ();
  return EstimateTargetPose(problem, has_pose, rays, 6, start);
}
Fit FitFirst(const BundleProblem& problem) {
  return FitFirst(problem, std::vector<bool>(problem.cameras.size(), true),
                  UndistortMarkers(problem));
}

void ExpectIsTheWand(const Fit& fit) {
  ASSERT_TRUE(fit);
  EXPECT_LT((fit->instant.origin_m - kWand.origin_m).norm(), 1e-6);
  EXPECT_LT((fit->instant.direction - kWand.direction.normalized()).norm(), 1e-6);
}

void ExpectNothing(const Fit& fit) { EXPECT_FALSE(fit); }

TEST(UndistortMarkers, GivesNormalisedCoordinates) {
  BundleProblem problem = ExactProblem({{0, 0, 0}}, {{{0, 0, 4}, {1, 0, 0}}});
  const std::vector<Eigen::Vector2d> rays = UndistortMarkers(problem);
  ASSERT_EQ(rays.size(), 3u);
  EXPECT_NEAR(rays[0].norm(), 0, 1e-12);
  EXPECT_NEAR(rays[2].x(), 0.39 / 4, 1e-12);
}

TEST(UndistortMarkers, GivesNaNWhereTheModelHasNoInverse) {
  BundleProblem problem = ExactProblem({{0, 0, 0}}, {{{0, 0, 4}}});
  problem.cameras[0].intrinsics[4] = -0.3;  // folds back at r = 1.05
  problem.markers[1].centre_px = {640 + 3000, 512};
  problem.markers[2].centre_px = {kNaN, 512};
  const std::vector<Eigen::Vector2d> rays = UndistortMarkers(problem);
  EXPECT_TRUE(rays[0].allFinite());
  EXPECT_FALSE(rays[1].allFinite());
  EXPECT_FALSE(rays[2].allFinite());
}

TEST(EstimateTargetPose, FindsTheExactPoseFromTwoCameras) {
  const Fit fit = FitFirst(ExactProblem({{0, 0, 0}, {1, 0, 0}}, {kWand}));
  ExpectIsTheWand(fit);
  EXPECT_EQ(fit->inliers, 6);
  EXPECT_EQ(fit->markers, 6);
}

TEST(EstimateTargetPose, FindsItThroughAnOutlier) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {kWand});
  problem.markers[4].centre_px += Eigen::Vector2d(-200, 130);
  const Fit fit = FitFirst(problem);
  ASSERT_TRUE(fit);
  // The outlier still pulls, by its Cauchy weight of (2/240)^2.
  EXPECT_LT((fit->instant.origin_m - kWand.origin_m).norm(), 0.002);
  EXPECT_EQ(fit->inliers, 8);
  EXPECT_EQ(fit->markers, 9);
}

TEST(EstimateTargetPose, LeavesOutMarkersThatAreNotUsed) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {kWand});
  problem.markers[1].centre_px = {0, 0};
  problem.markers[1].used = false;
  const Fit fit = FitFirst(problem);
  ExpectIsTheWand(fit);
  EXPECT_EQ(fit->markers, 5);
}

TEST(EstimateTargetPose, JoinsMarkersOfDifferentPairs) {
  // Marker 0 is shown by cameras 0 and 1 alone, marker 2 by cameras 2 and 3 alone.
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {kWand});
  for (size_t c = 0; c < 4; ++c) {
    for (size_t m = 0; m < 3; ++m) problem.markers[3 * c + m].used = m == (c < 2 ? 0 : 2);
  }
  ExpectIsTheWand(FitFirst(problem));
}

TEST(EstimateTargetPose, OneCameraIsNotEnough) {
  ExpectNothing(FitFirst(ExactProblem({{0, 0, 0}}, {kWand})));
  const BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {kWand});
  ExpectNothing(FitFirst(problem, {true, false}, UndistortMarkers(problem)));
}

TEST(EstimateTargetPose, OneMarkerIsNotEnough) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {kWand});
  for (const size_t m : {1, 2, 4, 5}) problem.markers[m].used = false;
  ExpectNothing(FitFirst(problem));
}

TEST(EstimateTargetPose, TwoCamerasAtOnePlaceAreNotEnough) {
  ExpectNothing(FitFirst(ExactProblem({{1, 0, 0}, {1, 0, 0}}, {kWand})));
}

TEST(EstimateTargetPose, AnInstantWithoutObservationsHasNoPose) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {kWand});
  problem.instants[0].observation_count = 0;
  ExpectNothing(FitFirst(problem));
}

TEST(EstimateTargetPose, RefusesATargetOfAnotherSize) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {kWand});
  problem.target.marker_positions_m = {0, 0.26, 0.78};
  ExpectNothing(FitFirst(problem));
}

TEST(EstimateTargetPose, RaysWithoutAnInverseTakeNoPart) {
  const BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {kWand});
  std::vector<Eigen::Vector2d> rays = UndistortMarkers(problem);
  rays[0].setConstant(kNaN);
  ExpectIsTheWand(FitFirst(problem, {true, true, true}, rays));
  for (Eigen::Vector2d& ray : rays) ray.setConstant(kNaN);
  ExpectNothing(FitFirst(problem, {true, true, true}, rays));
}

TEST(EstimateTargetPose, KeepsTheDirectionOfAWandNearlyAlongTheView) {
  const ExactWand along{{0.2, -0.1, 4}, {0.05, 0.02, -1}};
  const Fit fit = FitFirst(ExactProblem({{0, 0, 0}, {1, 0, 0}}, {along}));
  ASSERT_TRUE(fit);
  EXPECT_GT(fit->instant.direction.dot(along.direction.normalized()), 1 - 1e-9);
}

TEST(EstimateTargetPose, OfOneMarkerIsThePlaceWhereTwoCamerasSeeIt) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {kWand});
  problem.target.marker_positions_m = problem.target.given_positions_m = {0};
  for (BundleObservation& observation : problem.observations) observation.marker_count = 1;
  Fit fit = FitFirst(problem);
  ASSERT_TRUE(fit);
  EXPECT_LT((fit->instant.origin_m - kWand.origin_m).norm(), 1e-6);
  EXPECT_EQ(fit->instant.direction, Eigen::Vector3d(Eigen::Vector3d::UnitZ()));
  EXPECT_EQ(fit->inliers, 3);
  // One camera that is wrong is outvoted; one that is alone says nothing.
  problem.markers[static_cast<size_t>(problem.observations[2].first_marker)].centre_px.y() += 200;
  fit = FitFirst(problem);
  ASSERT_TRUE(fit);
  EXPECT_LT((fit->instant.origin_m - kWand.origin_m).norm(), 1e-3);
  EXPECT_EQ(fit->inliers, 2);
  ExpectNothing(FitFirst(problem, {true, false, false}, UndistortMarkers(problem)));
}

}  // namespace
}  // namespace rigcal::server::target_pose_test
