// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "tests/accuracy/solver/origin_experiment.h"
#include "tests/accuracy/solver/scale_experiment.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy {
namespace {

SimulationOptions SmallRig(uint32_t seed) {
  SimulationOptions simulation;
  simulation.seed = seed;
  simulation.camera_count = 4;
  simulation.duration_s = 12;
  return simulation;
}

// Two rigs; `rigcal-accuracy scale` has 200.
TEST(ScaleExperiment, IsHonestAndNamesTheWrongSource) {
  for (uint32_t seed = 1; seed <= 2; ++seed) {
    const ScaleTrial trial = RunScaleTrial(SmallRig(seed), {}, 0.02);
    ASSERT_THAT(trial.status, testing::IsOk());
    EXPECT_LT(trial.sigma_rel, trial.wand_sigma_rel);
    EXPECT_LT(std::abs(trial.error_rel), 4 * trial.sigma_rel);
    EXPECT_FALSE(trial.false_alarm);
    for (const bool named : trial.named) EXPECT_TRUE(named);
  }
}

// One rig; `rigcal-accuracy origin` has 100.
TEST(OriginExperiment, PutsTheFloorWhereItIs) {
  const OriginTrial trial = RunOriginTrial(SmallRig(3), 3);
  ASSERT_THAT(trial.status, testing::IsOk());
  EXPECT_EQ(trial.place_count, 3);
  // Four cameras see less of the floor than six.
  EXPECT_LT(trial.height_m, 0.003);
  EXPECT_LT(trial.tilt_deg, 0.1);
  EXPECT_LT(trial.nees, 30);  // six degrees of freedom: once in 25 000
}

}  // namespace
}  // namespace rigcal::accuracy
