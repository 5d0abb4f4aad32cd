// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/statistics.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "common/simulation/world/random_stream.h"

namespace rigcal::accuracy::statistics_test {
namespace {

TEST(Statistics, FiguresOfKnownValues) {
  EXPECT_DOUBLE_EQ(Mean({1, 2, 6}), 3);
  EXPECT_DOUBLE_EQ(RootMeanSquare({3, 4}), std::sqrt(12.5));
}

// Printed tables of chi-square: 0.005 and 0.995 quantiles for 10 degrees of freedom.
TEST(ChiSquareShareInterval, AgreesWithTables) {
  const Interval interval = ChiSquareShareInterval(10, 0.99);
  EXPECT_NEAR(interval.low, 0.2156, 1e-4);
  EXPECT_NEAR(interval.high, 2.5188, 1e-4);
  EXPECT_TRUE(interval.Contains(1));
  EXPECT_FALSE(interval.Contains(3));
}

TEST(NormalisedErrorSquared, UsesTheInverseOfAFullCovarianceOfMixedUnits) {
  Eigen::Matrix3d factor;
  factor << 1e3, 0, 0, 2e-3, 1e-6, 0, 5, 1e-3, 2;
  const Eigen::Matrix3d covariance = factor * factor.transpose();
  const Eigen::Vector3d unit(0.3, -1.2, 2);
  const Nees nees = NormalisedErrorSquared(factor * unit, covariance);
  EXPECT_EQ(nees.dof, 3);
  EXPECT_NEAR(nees.value, unit.squaredNorm(), 1e-6);
}

TEST(NormalisedErrorSquared, LeavesOutTheNullSpaceOfTheCovariance) {
  Eigen::Matrix3d projector = Eigen::Matrix3d::Identity() - Eigen::Matrix3d::Constant(1.0 / 3);
  const Eigen::Vector3d error = projector * Eigen::Vector3d(1, 2, 4);
  const Nees nees = NormalisedErrorSquared(error, 4 * projector);
  EXPECT_EQ(nees.dof, 2);
  EXPECT_NEAR(nees.value, error.squaredNorm() / 4, 1e-9);
  const Nees fixed =
      NormalisedErrorSquared(Eigen::Vector2d(1, 0), Eigen::Vector2d(1, 0).asDiagonal());
  EXPECT_EQ(fixed.dof, 1);
}

TEST(NormalisedErrorSquared, IsNanForAnInvalidCovariance) {
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
  covariance(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(NormalisedErrorSquared(Eigen::Vector2d(1, 1), covariance).value));
  EXPECT_TRUE(std::isnan(
      NormalisedErrorSquared(Eigen::Vector2d(std::nan(""), 1), Eigen::Matrix2d::Identity()).value));
}

TEST(NeesSum, SeparatesConsistentFromOverconfidentAndConservative) {
  NeesSum consistent, overconfident, conservative;
  RandomStream random{1};
  for (int trial = 0; trial < 500; ++trial) {
    const Eigen::Vector2d error(random.Gaussian(), random.Gaussian());
    consistent.Add(NormalisedErrorSquared(error, Eigen::Matrix2d::Identity()));
    overconfident.Add(NormalisedErrorSquared(error, 0.8 * Eigen::Matrix2d::Identity()));
    conservative.Add(NormalisedErrorSquared(error, 1.3 * Eigen::Matrix2d::Identity()));
  }
  EXPECT_EQ(consistent.dof(), 1000);
  EXPECT_EQ(consistent.trials(), 500);
  EXPECT_TRUE(consistent.ConsistentInterval(0.99).Contains(consistent.Ratio()));
  EXPECT_GT(overconfident.Ratio(), overconfident.ConsistentInterval(0.99).high);
  EXPECT_LT(conservative.Ratio(), conservative.ConsistentInterval(0.99).low);
}

}  // namespace
}  // namespace rigcal::accuracy::statistics_test
