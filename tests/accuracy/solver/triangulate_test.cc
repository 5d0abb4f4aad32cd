// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "tests/accuracy/solver/triangulate_experiment.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy {
namespace {

// Four rigs; `rigcal-accuracy triangulate` has 40, cell by cell.
TEST(TriangulateExperiment, ErrorsAreAsPredicted) {
  VoxelErrors all;
  for (uint32_t seed = 1; seed <= 4; ++seed) {
    SimulationOptions simulation;
    simulation.seed = seed;
    simulation.camera_count = 4;
    simulation.duration_s = 16;
    simulation.outlier_share = simulation.dropout_share = 0;
    const TriangulateTrial trial = RunTriangulateTrial(simulation);
    ASSERT_THAT(trial.status, testing::IsOk());
    all.Add(SumOf(trial.voxels));
  }
  ASSERT_GT(all.count, 1000);
  // The part of the calibration is one draw for each rig.
  EXPECT_NEAR(std::sqrt(all.squared_m2 / all.predicted_m2), 1, 0.5);
  EXPECT_NEAR(all.stated_m2 / all.predicted_m2, 1, 0.1);
}

}  // namespace
}  // namespace rigcal::accuracy
