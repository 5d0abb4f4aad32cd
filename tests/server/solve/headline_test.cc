// SPDX-License-Identifier: Apache-2.0
#include "server/solve/headline.h"

#include <gtest/gtest.h>

#include <limits>

namespace rigcal::server::headline_test {
namespace {

PredictedError Predicted(double stated_m, double by_folds_m, double by_intrinsics_m) {
  PredictedError predicted;
  predicted.stated_m = stated_m;
  predicted.by_folds_m = by_folds_m;
  predicted.by_intrinsics_m = by_intrinsics_m;
  return predicted;
}

TEST(UnstatedFactor, IsOneWhereTheCovarianceAndTheDataAgree) {
  EXPECT_EQ(UnstatedFactor(Predicted(0.002, 0.0015, 0)), 1);
  EXPECT_EQ(UnstatedFactor(Predicted(0.002, 0.0035, 0.001)), 1) << "four folds say it roughly";
}

TEST(UnstatedFactor, OtherIntrinsicsThatFitAsWellCountInFull) {
  EXPECT_DOUBLE_EQ(UnstatedFactor(Predicted(0.002, 0.003, 0.08)), 40);
}

TEST(UnstatedFactor, FoldsCountBeyondWhatTheyCanTell) {
  EXPECT_DOUBLE_EQ(UnstatedFactor(Predicted(0.002, 0.02, 0)), 5);
}

TEST(UnstatedFactor, IsOneWhereNothingIsStated) {
  EXPECT_EQ(UnstatedFactor(Predicted(0, 0.02, 0.02)), 1);
  EXPECT_EQ(UnstatedFactor(Predicted(std::numeric_limits<double>::infinity(), 0.02, 0)), 1);
}

}  // namespace
}  // namespace rigcal::server::headline_test
