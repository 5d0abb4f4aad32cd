// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/robustness_experiment.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::robustness_test {
namespace {

using ::rigcal::testing::IsOk;

constexpr int kSeeds = 4;
constexpr uint32_t kFirstSeed = 1000;  // not those of the table

std::vector<RobustnessTrial> RunSeeds(const std::string& name) {
  for (const RobustnessCase& entry : RobustnessCases(6, 30)) {
    if (entry.name != name) continue;
    auto trials = RunAll<RobustnessTrial>(kSeeds, 2, [&](int i) {
      return RunRobustnessTrial(entry, kFirstSeed + static_cast<uint32_t>(i));
    });
    for (const RobustnessTrial& trial : trials) EXPECT_THAT(trial.status, IsOk());
    return trials;
  }
  ADD_FAILURE() << "no case " << name;
  return {};
}

// The runs differ in noise: errors of two equal solvers over 4 seeds differ by up to a half.
TEST(RobustnessTest, FindsGrossOutliersInOneCameraAtLittleCost) {
  const std::vector<RobustnessTrial> clean = RunSeeds("clean");
  const std::vector<RobustnessTrial> bad = RunSeeds("30 % outliers");
  FateCounts fates;
  for (const RobustnessTrial& trial : bad) {
    ASSERT_TRUE(trial.fates);
    fates += *trial.fates;
  }
  EXPECT_GE(fates.OutlierPrecision(), 0.95);
  EXPECT_GE(fates.OutlierRecall(), 0.95);
  EXPECT_GT(fates.outlier_removed, 1000);
  EXPECT_LE(RatioOfRms(bad, clean), 1.5);
}

TEST(RobustnessTest, FlippedLabelsAreCorrectedOrRemoved) {
  const std::vector<RobustnessTrial> bad = RunSeeds("5 % flipped");
  FateCounts fates;
  for (const RobustnessTrial& trial : bad) {
    ASSERT_TRUE(trial.fates);
    fates += *trial.fates;
    EXPECT_LT(trial.position_rms_m, 0.002);
  }
  EXPECT_GE(fates.FlippedRecall(), 0.95);
  EXPECT_LE(fates.good_flipped, 2);
  EXPECT_GT(fates.flipped_corrected + fates.flipped_removed, 500);
}

// The lost information alone costs 1.57.
TEST(RobustnessTest, AllDefectsCostLittleMoreThanTheLostInformation) {
  const std::vector<RobustnessTrial> bad = RunSeeds("all of them");
  FateCounts fates;
  double squares = 0, bound_squares = 0;
  for (const RobustnessTrial& trial : bad) {
    ASSERT_TRUE(trial.fates);
    fates += *trial.fates;
    squares += trial.position_rms_m * trial.position_rms_m;
    bound_squares += trial.bound_rms_m * trial.bound_rms_m;
  }
  EXPECT_GE(fates.OutlierPrecision(), 0.95);
  EXPECT_GE(fates.OutlierRecall(), 0.95);
  EXPECT_GE(fates.FlippedRecall(), 0.95);
  EXPECT_GT(fates.outlier_removed, 500);
  // With few seeds the ratio depends mostly on the scale, common to all positions of a seed.
  EXPECT_LT(std::sqrt(squares / bound_squares), 1.6);
}

}  // namespace
}  // namespace rigcal::accuracy::robustness_test
