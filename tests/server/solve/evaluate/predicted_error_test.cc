// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/predicted_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace rigcal::server::predicted_error_test {
namespace {

TEST(FoldScatter, ChanceDoesNotCount) {
  std::mt19937 random{5};
  std::normal_distribution<double> normal;
  for (const int degrees : {3, 12}) {
    int counted = 0;
    for (int i = 0; i < 20'000; ++i) {
      FoldScatter scatter{.expected_m2 = 1e-6 * degrees,
                          .degrees_of_freedom = static_cast<double>(degrees)};
      for (int k = 0; k < degrees; ++k) scatter.squares_m2 += 1e-6 * std::pow(normal(random), 2);
      counted += scatter.Factor() > 1 ? 1 : 0;
    }
    // One of a thousand: 20, and four standard deviations either way.
    EXPECT_GT(counted, 2) << degrees;
    EXPECT_LT(counted, 38) << degrees;
  }
}

TEST(FoldScatter, WhatChanceDoesNotExplainCountsInFull) {
  EXPECT_DOUBLE_EQ((FoldScatter{100, 4, 6}).Factor(), 5);
  EXPECT_EQ((FoldScatter{8, 4, 6}).Factor(), 1);
  // More numbers tell more.
  EXPECT_DOUBLE_EQ((FoldScatter{8, 4, 60}).Factor(), std::sqrt(2));
}

TEST(FoldScatter, OfNothingIsOne) {
  EXPECT_EQ(FoldScatter().Factor(), 1);
  EXPECT_EQ((FoldScatter{1, 0, 3}).Factor(), 1);
  EXPECT_EQ((FoldScatter{std::numeric_limits<double>::quiet_NaN(), 1, 3}).Factor(), 1);
}

TEST(AllTogether, OnlyTheCovariancesPartGrowsWithTheFolds) {
  EXPECT_DOUBLE_EQ(AllTogether(3, 3, 1), 3);
  EXPECT_DOUBLE_EQ(AllTogether(3, 5, 1), 5);
  EXPECT_DOUBLE_EQ(AllTogether(3, 5, 2), std::hypot(6, 4));
}

}  // namespace
}  // namespace rigcal::server::predicted_error_test
