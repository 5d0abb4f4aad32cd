// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/block_scatter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "server/solve/evaluate/uncertainty.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::block_scatter_test {
namespace {

using ::rigcal::testing::IsOk;
using ::testing::ElementsAre;

BuiltProblem Instants(const std::vector<double>& times_s) {
  BuiltProblem built;
  for (const double time_s : times_s) {
    built.instant_time_ns.push_back(static_cast<int64_t>(1e9 * time_s));
    built.problem.instants.emplace_back();
  }
  return built;
}

TEST(BlockScatter, BlocksAreCutByTimeAndAtPauses) {
  // Little was recorded: the shortest blocks.
  EXPECT_THAT(CutIntoBlocks(Instants({0, 0.1, 0.2, 0.6, 0.7, 30, 30.1})), ElementsAre(0, 3, 5, 7));
  // The clock of the next session begins earlier.
  EXPECT_THAT(CutIntoBlocks(Instants({10, 10.1, 5, 5.1})), ElementsAre(0, 2, 4));
  EXPECT_TRUE(CutIntoBlocks(Instants({})).empty());
  std::vector<double> minute_s;
  for (int i = 0; i < 600; ++i) minute_s.push_back(0.1 * i);
  EXPECT_EQ(CutIntoBlocks(Instants(minute_s)).size(), 31u);
}

// Each camera's centres are off by the same amount for half a second, then by another.
void ShiftTogether(double sigma_px, uint32_t seed, CalibrationInput* input) {
  for (size_t t = 0; t < input->tracks.size(); ++t) {
    for (Observation& row : input->tracks[t].observations) {
      const auto block = static_cast<uint32_t>(row.time_ns / 500'000'000);
      std::mt19937 bits(seed + 1000 * static_cast<uint32_t>(t) + 77777 * block);
      std::normal_distribution<double> normal(0, sigma_px);
      const Eigen::Vector2d shift_px(normal(bits), normal(bits));
      for (MarkerObservation& marker : row.markers) marker.centre_px += shift_px;
    }
  }
}

struct Solved {
  double design_effect = 0;
  double mean_square = 0;  // of position errors over their sigmas
};

Solved Solve(uint32_t seed, double common_px, const std::vector<Target>& targets = {WandTarget()},
             const std::string& length = "duration=40;rate=20") {
  const auto worlds =
      WorldsOf("cameras=4;outliers=0;" + length + ";seed=" + std::to_string(seed), targets);
  const SimulatedWorld& world = worlds.front();
  CalibrationInput input = worlds.size() == 1 ? InputOf(world) : MixedInputOf(worlds);
  ShiftTogether(common_px, seed, &input);
  CalibrationOptions options;
  options.intrinsics = options.marker_positions = Estimate::kFixed;
  // Each pose of the body is a small solve by itself.
  if (worlds.size() > 1 || !targets.front().IsLine()) options.time_offsets = Estimate::kFixed;
  Solved solved;
  CalibrationHooks hooks;
  hooks.solved = [&](const RigObservations&, const RigSolution& solution) {
    ASSERT_OK_AND_ASSIGN(const RigUncertainty stated, ComputeUncertainty(solution, {}));
    solved.design_effect = stated.design_effect;
  };
  const CalibrationOutcome outcome = Calibrate(std::move(input), options, hooks);
  EXPECT_THAT(outcome.result, IsOk());
  if (!outcome.result.ok()) return solved;
  const RigidTransform reference_from_world = world.cameras()[0].cam_from_rig;
  for (size_t c = 1; c < 4; ++c) {
    const CalibratedCamera& camera = outcome.result->cameras[c];
    const Eigen::Vector3d error =
        camera.cam_from_rig.SourceFromTargetTranslation() -
        reference_from_world * world.cameras()[c].cam_from_rig.SourceFromTargetTranslation();
    solved.mean_square +=
        error.cwiseQuotient(camera.uncertainty->position_sigma_m).squaredNorm() / 9;
  }
  return solved;
}

// Twenty blocks of 18 parameters: the design effect scatters by a fifth.
TEST(BlockScatter, IndependentErrorsAddNothing) {
  for (const uint32_t seed : {1u, 2u}) {
    const Solved solved = Solve(seed, 0);
    EXPECT_GT(solved.design_effect, 0.75);
    EXPECT_LT(solved.design_effect, 1.25);
  }
}

// Errors of twice the noise that last for half a second, in which the wand is seen ten times: the
// noise of the centres alone would state a fraction of the errors.
TEST(BlockScatter, ErrorsInCommonAreStated) {
  double mean_square = 0;
  const std::vector<uint32_t> seeds = {1, 2, 3, 4};
  for (const uint32_t seed : seeds) {
    const Solved solved = Solve(seed, 0.6);
    EXPECT_GT(solved.design_effect, 10) << seed;
    mean_square += solved.mean_square / static_cast<double>(seeds.size());
  }
  // 36 values that share the reference camera's errors: wide limits.
  EXPECT_GT(mean_square, 0.4);
  EXPECT_LT(mean_square, 2.5);
}

// The general path has the same, of a rigid target and of two targets. Ten blocks of 18 parameters.
TEST(BlockScatter, OfRigidAndMixedTargets) {
  const std::string length = "duration=20;rate=10";
  for (const std::vector<Target>& targets :
       {std::vector<Target>{BodyTarget(0)}, std::vector<Target>{WandTarget(), BodyTarget(0)}}) {
    const Solved independent = Solve(1, 0, targets, length);
    EXPECT_GT(independent.design_effect, 0.6);
    EXPECT_LT(independent.design_effect, 1.5);
    double mean_square = 0;
    for (const uint32_t seed : {1u, 2u}) {
      const Solved solved = Solve(seed, 0.6, targets, length);
      EXPECT_GT(solved.design_effect, 4) << seed;
      mean_square += solved.mean_square / 2;
    }
    EXPECT_GT(mean_square, 0.3);
    EXPECT_LT(mean_square, 3);
  }
}

}  // namespace
}  // namespace rigcal::server::block_scatter_test
