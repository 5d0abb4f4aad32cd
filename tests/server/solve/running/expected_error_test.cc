// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/expected_error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::expected_error_test {
namespace {

// Two cameras one metre apart that look along z, and the target in a box two metres before them.
BundleProblem TwoCameras() {
  BundleProblem problem;
  for (const double x_m : {0.0, 1.0}) {
    BundleCamera camera;
    camera.name = x_m == 0 ? "left" : "right";
    camera.cam_from_rig = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(-x_m, 0, 0)};
    Intrinsics intrinsics;
    intrinsics.fx_px = intrinsics.fy_px = 1000;
    intrinsics.cx_px = 639.5;
    intrinsics.cy_px = 511.5;
    camera.intrinsics = ToVector(intrinsics);
    problem.cameras.push_back(camera);
  }
  problem.target.marker_positions_m = {0, 0.1, 0.2};
  for (int i = 0; i < 100; ++i) {
    BundleInstant instant;
    instant.origin_m = {0.3 + 0.4 * (i % 10) / 9.0, -0.2 + 0.4 * (i / 10 % 10) / 9.0,
                        2 + 0.3 * (i % 7) / 6.0};
    instant.direction = Eigen::Vector3d::UnitY();
    problem.instants.push_back(instant);
  }
  return problem;
}

std::vector<CameraDescription> Descriptions() {
  std::vector<CameraDescription> cameras(2);
  for (CameraDescription& camera : cameras) camera.image_size_px = {1280, 1024};
  return cameras;
}

TEST(WavedGrid, HoldsTheWavedVolumeAndAStepBeyond) {
  const WavedGrid grid = MeasureWavedGrid(TwoCameras(), 1000);
  ASSERT_GT(grid.size(), 100u);
  ASSERT_LE(grid.size(), 1000u);
  const Eigen::Vector3d last = grid.Point(grid.size() - 1);
  EXPECT_LT(grid.origin_m.x(), 0.3 - 0.5 * grid.step_m);
  EXPECT_GT(last.x(), 0.7 + 0.5 * grid.step_m);
  EXPECT_LT(grid.origin_m.y(), -0.2);
  EXPECT_GT(last.y(), 0.4);
  uint32_t count = 0;
  for (size_t i = 0; i < grid.size(); ++i) {
    count += grid.wand_counts[i];
    EXPECT_TRUE(grid.wand_counts[i] == 0 || grid.inside[i]);
    EXPECT_EQ(grid.Nearest(grid.Point(i)), i);
  }
  EXPECT_GT(count, 280u);  // ends and middle of 100, but for the outermost
  EXPECT_FALSE(grid.Nearest({100, 0, 0}));
}

TEST(WavedGrid, NothingPlacedIsNoGrid) {
  BundleProblem problem = TwoCameras();
  for (BundleInstant& instant : problem.instants) instant.used = false;
  EXPECT_EQ(MeasureWavedGrid(problem, 1000).size(), 0u);
}

TEST(PointGains, IsTheDerivativeOfTriangulation) {
  // A shift of the right camera by dx moves a point at depth z by z / b * dx along z.
  const BundleProblem problem = TwoCameras();
  const WavedGrid grid = MeasureWavedGrid(problem, 500);
  std::vector<ReducedParameter> parameters;
  for (int i = 0; i < 3; ++i) parameters.push_back({ReducedParameterKind::kRotation, 1, i});
  for (int i = 0; i < 3; ++i) parameters.push_back({ReducedParameterKind::kTranslation, 1, i});
  const PointGains gains = ComputeGains(problem, Descriptions(), parameters, grid, 0.3);
  ASSERT_GT(gains.points.size(), 50u);
  ASSERT_EQ(gains.gain.rows(), static_cast<Eigen::Index>(3 * gains.points.size()));
  for (size_t i = 0; i < gains.points.size(); ++i) {
    const double depth_m = grid.Point(gains.points[i]).z();
    // cam_from_rig.translation is minus the centre.
    EXPECT_NEAR(std::abs(gains.gain(static_cast<Eigen::Index>(3 * i + 2), 3)), depth_m,
                0.02 * depth_m);
    // In depth sqrt(2) sigma z^2 / (f b), and a little across.
    const double depth_noise_m = std::sqrt(2.0) * 0.3 * depth_m * depth_m / 1000;
    EXPECT_GT(gains.noise_m[i], 0.99 * depth_noise_m);
    EXPECT_LT(gains.noise_m[i], 1.2 * depth_noise_m);
  }
}

TEST(PointGains, BetweenCamerasThatFaceEachOtherThereAreNone) {
  // The wand is waved around the line between the two.
  BundleProblem problem = TwoCameras();
  problem.cameras[0].cam_from_rig = {Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()};
  problem.cameras[1].cam_from_rig = {Eigen::Quaterniond(0, 0, 1, 0), Eigen::Vector3d(0, 0, 4)};
  for (BundleInstant& instant : problem.instants) instant.origin_m -= Eigen::Vector3d(0.5, 0, 0);
  const WavedGrid grid = MeasureWavedGrid(problem, 1000);
  const PointGains gains = ComputeGains(problem, Descriptions(), {}, grid, 0.3);
  for (const size_t point : gains.points) {
    EXPECT_GT(grid.Point(point).head<2>().norm(), 0.03) << grid.Point(point).transpose();
  }
  const std::optional<size_t> between = grid.Nearest({0, 0, 2.1});
  ASSERT_TRUE(between);
  EXPECT_EQ(std::ranges::count(gains.points, *between), 0);
}

TEST(PointGains, ASubsetKeepsItsRows) {
  const BundleProblem problem = TwoCameras();
  const WavedGrid grid = MeasureWavedGrid(problem, 500);
  std::vector<ReducedParameter> parameters;
  for (int i = 0; i < 3; ++i) parameters.push_back({ReducedParameterKind::kTranslation, 1, i});
  const PointGains all = ComputeGains(problem, Descriptions(), parameters, grid, 0.3);
  const PointGains few = ChoosePoints(all, 10);
  ASSERT_GE(few.points.size(), 5u);
  ASSERT_LE(few.points.size(), 10u);
  for (size_t i = 0; i < few.points.size(); ++i) {
    const auto at =
        static_cast<size_t>(std::ranges::find(all.points, few.points[i]) - all.points.begin());
    ASSERT_LT(at, all.points.size());
    EXPECT_EQ(few.gain(static_cast<Eigen::Index>(3 * i + 2), 0),
              all.gain(static_cast<Eigen::Index>(3 * at + 2), 0));
    EXPECT_EQ(few.noise_m[i], all.noise_m[at]);
  }
}

TEST(ExpectedError, ForgetsWhatARigidMotionTakesAway) {
  // Both cameras free, and an error that moves them alike: the rig as a whole.
  const BundleProblem problem = TwoCameras();
  const WavedGrid grid = MeasureWavedGrid(problem, 500);
  std::vector<ReducedParameter> parameters;
  for (int c = 0; c < 2; ++c) {
    for (int i = 0; i < 3; ++i) parameters.push_back({ReducedParameterKind::kTranslation, c, i});
  }
  const PointGains gains = ComputeGains(problem, Descriptions(), parameters, grid, 0.3);
  Eigen::VectorXd together = Eigen::VectorXd::Zero(6);
  together << 1, 0, 0, 1, 0, 0;
  const ExpectedError none =
      ComputeExpectedError(gains, 1e-4 * together * together.transpose(), grid);
  EXPECT_LT(none.worst_m, 1e-9);
  EXPECT_LT(none.p95_m, 1e-9);
  Eigen::VectorXd apart = Eigen::VectorXd::Zero(6);
  apart << 1, 0, 0, -1, 0, 0;
  const ExpectedError some = ComputeExpectedError(gains, 1e-6 * apart * apart.transpose(), grid);
  EXPECT_GT(some.median_m, 1e-4);
  EXPECT_GE(some.worst_m, some.median_m);
  // One normal number moves all points: half of such calibrations have less than 0.67 of its sigma,
  // and 95 % less than 1.96 (64 draws).
  std::vector<double> sigma_m = some.sigma_m;
  const double of_places_m = UpperQuantile(&sigma_m, 0.95);
  EXPECT_NEAR(some.p95_m / of_places_m, 0.67, 0.2);
  EXPECT_NEAR(some.p95_bound_m / of_places_m, 1.96, 0.4);
}

TEST(ExpectedError, NothingSeenIsZero) {
  const ExpectedError error = ComputeExpectedError({}, Eigen::MatrixXd::Identity(3, 3), {});
  EXPECT_EQ(error.p95_m, 0);
  EXPECT_TRUE(error.points.empty());
}

}  // namespace
}  // namespace rigcal::server::expected_error_test
