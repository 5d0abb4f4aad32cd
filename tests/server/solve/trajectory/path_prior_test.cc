// SPDX-License-Identifier: Apache-2.0
#include "server/solve/trajectory/path_prior.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/server/solve/trajectory/trajectory_scene.h"

namespace rigcal::server::path_prior_test {
namespace {

TrajectoryProblem ShakyPath(bool is_point) {
  TrajectorySceneOptions options;
  options.duration_s = 1;
  options.is_point = is_point;
  return MakeTrajectoryScene(options).initial;
}

struct Information {
  explicit Information(const TrajectoryProblem& problem)
      : matrix(problem.spans[0].knots.size(), 4 * problem.spans[0].size - 1),
        gradient(Eigen::VectorXd::Zero(problem.spans[0].knots.size())) {
    AddPathPrior(problem, 0, &matrix, &gradient);
  }
  BandedMatrix matrix;
  Eigen::VectorXd gradient;
};

TEST(PathPriorTest, SteadyMotionWithoutTurnCostsNothing) {
  TrajectoryProblem problem = ShakyPath(false);
  TrajectorySpan& span = problem.spans[0];
  for (Eigen::Index k = 0; k < span.knot_count(); ++k) {
    const double t = static_cast<double>(k);
    span.knots.segment<3>(k * span.size) << 0.1 * t, 1 - 0.02 * t * t, 3;
    span.knots.segment<3>(k * span.size + 3) << 0.6, 0, 0.8;
  }
  EXPECT_NEAR(PathPriorCost(problem), 0, 1e-12);
  EXPECT_LT(Information(problem).gradient.norm(), 1e-6);
}

TEST(PathPriorTest, GradientIsThatOfTheCost) {
  for (const bool is_point : {false, true}) {
    TrajectoryProblem problem = ShakyPath(is_point);
    const Eigen::VectorXd gradient = Information(problem).gradient;
    constexpr double kStep = 1e-6;
    for (Eigen::Index i = 0; i < gradient.size(); ++i) {
      double& number = problem.spans[0].knots[i];
      const double before = number;
      number = before + kStep;
      const double above = PathPriorCost(problem);
      number = before - kStep;
      const double below = PathPriorCost(problem);
      number = before;
      EXPECT_NEAR((above - below) / (2 * kStep), gradient[i], 1e-5 * gradient.norm());
    }
  }
}

TEST(PathPriorTest, FreedomIsWhatTheDataDecide) {
  const TrajectoryProblem problem = ShakyPath(false);
  const auto numbers = static_cast<double>(problem.spans[0].knots.size());
  BandedMatrix matrix = Information(problem).matrix;
  ASSERT_TRUE(matrix.Factor());
  PathFreedom none;
  AddPathFreedom(problem, 0, matrix.Inverse(), &none);
  EXPECT_NEAR(none.values, 0, 1e-6 * numbers);
  EXPECT_NEAR(none.origin_by_data, 0, 1e-6 * numbers);
  EXPECT_NEAR(none.direction_by_data, 0, 1e-6 * numbers);

  // Data that say each number of the knots to a nanometre.
  BandedMatrix certain = Information(problem).matrix;
  for (Eigen::Index i = 0; i < certain.size(); ++i) certain(i, i) += 1e18;
  ASSERT_TRUE(certain.Factor());
  PathFreedom all;
  AddPathFreedom(problem, 0, certain.Inverse(), &all);
  EXPECT_NEAR(all.values, numbers, 1e-6 * numbers);
  const double differences = 3 * static_cast<double>(problem.spans[0].knot_count() - 3);
  EXPECT_NEAR(all.origin_by_data, differences, 1e-3 * differences);
  // A path of points costs half the sum of their squares.
  const TrajectoryProblem points = ShakyPath(true);
  BandedMatrix points_certain = Information(points).matrix;
  for (Eigen::Index i = 0; i < points_certain.size(); ++i) points_certain(i, i) += 1e18;
  ASSERT_TRUE(points_certain.Factor());
  PathFreedom of_points;
  AddPathFreedom(points, 0, points_certain.Inverse(), &of_points);
  EXPECT_NEAR(of_points.origin_square * std::pow(points.origin_sigma, -2),
              2 * PathPriorCost(points), 1e-9 * PathPriorCost(points));
}

}  // namespace
}  // namespace rigcal::server::path_prior_test
