// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <vector>

#include "tests/accuracy/solver/line_delays_experiment.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::line_delays_test {
namespace {

using ::rigcal::testing::IsOk;

TEST(LineDelaysTest, RollingShuttersInAllCamerasCostNothing) {
  LineDelaysOptions options;
  options.duration_s = 20;
  std::vector<LineDelaysTrial> trials;
  for (uint32_t seed = 1; seed <= 2; ++seed) trials.push_back(RunLineDelaysTrial(options, seed));
  for (const LineDelaysTrial& trial : trials) {
    ASSERT_THAT(trial.status, IsOk());
    EXPECT_EQ(trial.missed, 0);
  }
  const LineDelaysSummary summary = Summarise(trials);
  EXPECT_LT(summary.rmse_by_bound, 2.5);
  EXPECT_LT(summary.delay_by_bound, 1.8);
  EXPECT_LT(summary.offset_by_bound, 1.8);
}

}  // namespace
}  // namespace rigcal::accuracy::line_delays_test
