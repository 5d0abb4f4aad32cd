// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/loss_factors.h"

#include <gtest/gtest.h>

#include <cmath>

namespace rigcal::server::loss_factors_test {
namespace {

constexpr int kCount = 100'000;

// |e|^2 of normal errors in two dimensions is distributed as exp(-s / 2) / 2: its quantiles.
double Quantile(int i) { return -2 * std::log(1 - (i + 0.5) / kCount); }

// The covariance that comes out, by the Cramer-Rao bound: the information of the solve is
// that of the errors times the mean weight.
double CovarianceByBound(double loss_scale, double size, double leverage) {
  LossSum sum(loss_scale);
  double weight = 0;
  for (int i = 0; i < kCount; ++i) {
    const double residual = size * size * Quantile(i) * (1 - leverage);
    sum.Add(residual, 1, leverage);
    weight += 1 / (1 + residual / (loss_scale * loss_scale)) / kCount;
  }
  return sum.Factors(0).variance / weight;
}

TEST(LossSumTest, CauchyAtTwoSigmasCostsNinePercent) {
  EXPECT_NEAR(CovarianceByBound(2, 1, 0), 1.0919, 1e-3);
}

TEST(LossSumTest, AWideLossCostsNothingAndTheErrorsCountAsTheyAre) {
  EXPECT_NEAR(CovarianceByBound(1e4, 1, 0), 1, 1e-3);
  EXPECT_NEAR(CovarianceByBound(1e4, 3, 0), 9, 1e-2);
}

// Residuals that have lost a part of their variance to the fit, or to interpolation.
TEST(LossSumTest, SmallerResidualsAreOfTheSameErrors) {
  EXPECT_NEAR(CovarianceByBound(1e4, 1, 0.5), 1, 1e-3);
  LossSum interpolated(1e4);
  for (int i = 0; i < kCount; ++i) interpolated.Add(0.4 * Quantile(i), 0.4, 0);
  EXPECT_NEAR(interpolated.Factors(0).variance, 1, 1e-3);
}

TEST(LossSumTest, SaysNothingWhereNothingIsLeftOver) {
  LossSum sum(2);
  EXPECT_EQ(sum.Factors(0).variance, 1);
  sum.Add(5, 1, 0);
  EXPECT_EQ(sum.count(), 1);
  EXPECT_EQ(sum.Factors(2).variance, 1);
  EXPECT_NE(sum.Factors(1).variance, 1);
}

}  // namespace
}  // namespace rigcal::server::loss_factors_test
