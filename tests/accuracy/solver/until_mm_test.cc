// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/until_mm_experiment.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::until_mm_test {
namespace {

using ::rigcal::testing::IsOk;

constexpr double kUntilMm = 1;

UntilOptions Options() {
  UntilOptions options;
  options.camera_count = 4;
  options.duration_s = 40;
  options.until_mm = kUntilMm;
  return options;
}

// Seeds other than those of the table.
TEST(UntilMm, WhereItStopsTheErrorIsBelowTheTarget) {
  const auto trials = RunAll<UntilTrial>(
      4, 2, [](int i) { return RunUntilTrial(Options(), static_cast<uint32_t>(2000 + i)); });
  for (const UntilTrial& trial : trials) {
    ASSERT_THAT(trial.status, IsOk());
    const int stop = trial.StopAt(kUntilMm);
    ASSERT_GE(stop, 0);
    EXPECT_LT(trial.steps[static_cast<size_t>(stop)].true_mm, kUntilMm);
    EXPECT_LT(trial.calibrated_mm, kUntilMm);
  }
}

// Lenses described ten times worse than what the test of the given ones lets pass.
TEST(UntilMm, LensesThatAreNotAsDescribedDoNotEndItTooEarly) {
  UntilOptions options = Options();
  options.lens_error = 1;
  options.until_mm = 2;
  const UntilTrial trial = RunUntilTrial(options, 2010);
  ASSERT_THAT(trial.status, IsOk());
  const int stop = trial.StopAt(options.until_mm);
  if (stop >= 0) {
    // What is stated is the likely error: half of such rigs end above it, and hardly one by half.
    EXPECT_LT(trial.steps[static_cast<size_t>(stop)].true_mm, 1.5 * options.until_mm);
    EXPECT_LT(trial.calibrated_mm, 1.5 * options.until_mm);
  }
  // The stated error is never far below the true one.
  int stated = 0;
  for (const UntilStep& step : trial.steps) {
    if (step.predicted_mm <= 0 || !step.agrees) continue;
    ++stated;
    EXPECT_LT(step.true_mm, 2 * step.predicted_mm) << step.time_s << " s";
  }
  EXPECT_GT(stated, 0);
}

TEST(UntilMm, TheStepsAreFound) {
  UntilTrial trial;
  for (const double predicted_mm : {0.0, 2.0, 0.9, 0.8}) {
    UntilStep step;
    step.predicted_mm = predicted_mm;
    step.poorest_views = 100 * static_cast<int>(trial.steps.size());
    step.agrees = predicted_mm < 0.85;
    trial.steps.push_back(step);
  }
  EXPECT_EQ(trial.StopAt(1), 3);  // 0.9 did not agree
  EXPECT_EQ(trial.StopAt(0.5), -1);
  EXPECT_EQ(trial.StepWithViews(150), 2);
  EXPECT_EQ(trial.StepWithViews(1000), -1);
}

}  // namespace
}  // namespace rigcal::accuracy::until_mm_test
