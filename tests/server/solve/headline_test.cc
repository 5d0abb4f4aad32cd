// SPDX-License-Identifier: Apache-2.0
#include "server/solve/headline.h"

#include <gtest/gtest.h>

#include <cmath>

namespace rigcal::server::headline_test {
namespace {

TEST(PointError, IsTheCovariancesWhereNothingElseSpeaks) {
  const PointError error = {.by_covariance_m = 0.002, .with_lenses_m = 0.002, .fold_factor = 1};
  EXPECT_DOUBLE_EQ(error.StatedM(), 0.002);
  EXPECT_EQ(error.Basis(), ErrorBasis::kCovariance);
}

TEST(PointError, KeptLensesAddInSquaresAndDecideWhereTheyAreMost) {
  PointError error = {.by_covariance_m = 0.003, .with_lenses_m = 0.004};
  EXPECT_DOUBLE_EQ(error.StatedM(), 0.004);
  EXPECT_EQ(error.Basis(), ErrorBasis::kCovariance);
  error.with_lenses_m = 0.005;
  EXPECT_DOUBLE_EQ(error.StatedM(), 0.005);
  EXPECT_EQ(error.Basis(), ErrorBasis::kLenses);
}

TEST(PointError, WhatFoldsScatterByIsNoMatterOfTheLenses) {
  PointError error = {.by_covariance_m = 0.003, .with_lenses_m = 0.005, .fold_factor = 3};
  EXPECT_DOUBLE_EQ(error.StatedM(), std::hypot(0.009, 0.004));
  EXPECT_EQ(error.Basis(), ErrorBasis::kFolds);
  error.fold_factor = 1.1;
  EXPECT_EQ(error.Basis(), ErrorBasis::kLenses);
}

TEST(PointError, IsBoundedByTheSameShareOfAllItsParts) {
  const PointError error = {
      .by_covariance_m = 0.003, .with_lenses_m = 0.005, .fold_factor = 3, .bound_factor = 2};
  EXPECT_DOUBLE_EQ(error.BoundM(), 2 * error.StatedM());
}

TEST(PointError, OfNothingIsUnknown) {
  EXPECT_EQ(PointError().StatedM(), 0);
  EXPECT_EQ(PointError().Basis(), ErrorBasis::kUnknown);
}

}  // namespace
}  // namespace rigcal::server::headline_test
