// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/consistency_experiment.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::consistency_test {
namespace {

using ::rigcal::testing::IsOk;

constexpr int kSeeds = 12;
constexpr uint32_t kFirstSeed = 1000;  // not those of the table

// The interval of 999 of 1000 consistent solvers. Above it the robust loss may cost 10 % of
// variance; a covariance half or twice as large as it should be is far outside for shape and
// intrinsics, which have hundreds of degrees of freedom. The scale, one value per seed, shows only
// gross errors.
TEST(ConsistencyTest, StatedUncertaintyMatchesTheErrors) {
  ConsistencyOptions options;
  options.camera_count = 4;
  options.duration_s = 20;
  const auto trials = RunAll<ConsistencyTrial>(kSeeds, 1, [&](int i) {
    return RunConsistencyTrial(options, kFirstSeed + static_cast<uint32_t>(i));
  });
  for (const ConsistencyTrial& trial : trials) {
    ASSERT_THAT(trial.status, IsOk());
    ASSERT_TRUE(trial.stated);
  }
  std::map<std::string, int> dof;
  for (const ConsistencyPart& part : SummariseParts(trials)) {
    if (part.stated.dof() == 0) continue;
    dof[part.name] = part.stated.dof();
    const Interval interval = part.stated.ConsistentInterval(0.998);
    EXPECT_GT(part.stated.Ratio(), interval.low) << part.name;
    EXPECT_LT(part.stated.Ratio(), 1.1 * interval.high) << part.name;
  }
  // No part was left out.
  EXPECT_GT(dof["shape"], 150);
  EXPECT_EQ(dof["scale"], kSeeds);
  EXPECT_EQ(dof["offsets"], 3 * kSeeds);
  EXPECT_GT(dof["intrinsics"], 200);
}

}  // namespace
}  // namespace rigcal::accuracy::consistency_test
