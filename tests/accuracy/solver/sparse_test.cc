// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <vector>

#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/solver/sparse_experiment.h"
#include "tests/server/solve/recorded_input.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::sparse_test {
namespace {

using ::rigcal::testing::IsOk;

// Cameras that run together still do so when most of their rows are lost. Taken for free-running
// ones they were 76 mm (median) off.
TEST(SparseTest, LostRowsCostMillimetres) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  ASSERT_OK_AND_ASSIGN(const server::CalibrationInput input, server::RecordedInput(data));
  const server::CalibrationOutcome whole = server::Calibrate(input, {});
  ASSERT_THAT(whole.result, IsOk());
  std::vector<double> worst_m;
  for (uint32_t seed = 1; seed <= 5; ++seed) {
    const SparseRun run = RunSparse(input, *whole.result, 0.7, seed);
    ASSERT_THAT(run.status, IsOk());
    EXPECT_LT(run.worst_sigmas, 3);
    worst_m.push_back(run.worst_m);
  }
  EXPECT_LT(InterpolatedQuantile(worst_m, 0.5), 0.010);
  EXPECT_LT(InterpolatedQuantile(worst_m, 1), 0.025);
}

}  // namespace
}  // namespace rigcal::accuracy::sparse_test
