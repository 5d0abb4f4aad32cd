// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/block_scatter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_solver.h"
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

// Blocks of a large rig, of which each tells of few parameters: what is left out is as good as
// zeros.
TEST(BlockScatter, BlocksOfSomeParametersScatterAsWithZerosForTheOthers) {
  constexpr Eigen::Index kSize = 12, kOwn = 4;
  std::mt19937 bits(5);
  std::normal_distribution<double> normal;
  const auto draw = [&](Eigen::Index rows, Eigen::Index columns) -> Eigen::MatrixXd {
    return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(bits); });
  };
  std::vector<BlockInformation> parts, wholes;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(kSize, kSize);
  for (Eigen::Index b = 0; b < 9; ++b) {
    const Eigen::MatrixXd slopes = draw(9, kOwn);
    BlockInformation part{{}, slopes.transpose() * slopes, 3 * draw(kOwn, 1).col(0)};
    BlockInformation whole{{}, Eigen::MatrixXd::Zero(kSize, kSize), Eigen::VectorXd::Zero(kSize)};
    for (Eigen::Index i = 0; i < kOwn; ++i) part.rows.push_back((b + 3 * i) % kSize);
    for (Eigen::Index i = 0; i < kSize; ++i) whole.rows.push_back(i);
    whole.information(part.rows, part.rows) = part.information;
    whole.score(part.rows) = part.score;
    information += whole.information;
    parts.push_back(std::move(part));
    wholes.push_back(std::move(whole));
  }
  const Eigen::MatrixXd covariance = information.inverse();
  BlockScatterSum of_parts(covariance, {1.1, 0.9}), of_wholes(covariance, {1.1, 0.9});
  for (const BlockInformation& part : parts) of_parts.Add(part);
  for (const BlockInformation& whole : wholes) of_wholes.Add(whole);
  const BlockScatter by_parts = of_parts.Finish(), by_wholes = of_wholes.Finish();
  ASSERT_EQ(by_parts.block_count(), 9);
  ASSERT_GT(by_wholes.changes.norm(), 0.1);
  EXPECT_LT((by_parts.changes - by_wholes.changes).norm(), 1e-12 * by_wholes.changes.norm());
  EXPECT_NEAR(by_parts.design_effect, by_wholes.design_effect, 1e-12 * by_wholes.design_effect);
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

double MeanSquare(const SimulatedWorld& world, const std::vector<RigidTransform>& cam_from_rig,
                  const std::vector<Eigen::Vector3d>& sigma_m) {
  const RigidTransform reference_from_world = world.cameras()[0].cam_from_rig;
  double mean_square = 0;
  for (size_t c = 1; c < 4; ++c) {
    const Eigen::Vector3d error =
        cam_from_rig[c].SourceFromTargetTranslation() -
        reference_from_world * world.cameras()[c].cam_from_rig.SourceFromTargetTranslation();
    mean_square += error.cwiseQuotient(sigma_m[c]).squaredNorm() / 9;
  }
  return mean_square;
}

Solved Solve(uint32_t seed, double common_px) {
  const SimulatedWorld world = WorldOf(
      "cameras=4;duration=40;rate=20;outliers=0;seed=" + std::to_string(seed), WandTarget());
  CalibrationInput input = InputOf(world);
  ShiftTogether(common_px, seed, &input);
  CalibrationOptions options;
  options.intrinsics = options.marker_positions = Estimate::kFixed;
  Solved solved;
  CalibrationHooks hooks;
  hooks.solved = [&](const RigObservations&, const RigSolution& solution) {
    ASSERT_OK_AND_ASSIGN(const RigUncertainty stated, ComputeUncertainty(solution, {}));
    solved.design_effect = stated.design_effect;
  };
  const CalibrationOutcome outcome = Calibrate(std::move(input), options, hooks);
  EXPECT_THAT(outcome.result, IsOk());
  if (!outcome.result.ok()) return solved;
  std::vector<RigidTransform> poses;
  std::vector<Eigen::Vector3d> sigma_m;
  for (const CalibratedCamera& camera : outcome.result->cameras) {
    poses.push_back(camera.cam_from_rig);
    sigma_m.push_back(camera.uncertainty->position_sigma_m);
  }
  solved.mean_square = MeanSquare(world, poses, sigma_m);
  return solved;
}

// Poses alone, without evaluation.
Solved SolveOnce(uint32_t seed, double common_px, const std::vector<Target>& targets) {
  const auto worlds =
      WorldsOf("cameras=4;duration=30;rate=10;outliers=0;seed=" + std::to_string(seed), targets);
  CalibrationInput input = MixedInputOf(worlds);
  ShiftTogether(common_px, seed, &input);
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(input, &clocks);
  RigSolveOptions options;
  options.estimate_time_offsets = false;
  Solved solved;
  const absl::StatusOr<RigSolution> solution = SolveRig(rig, clocks, options);
  EXPECT_THAT(solution, IsOk());
  if (!solution.ok()) return solved;
  const absl::StatusOr<RigUncertainty> stated = ComputeUncertainty(*solution, options);
  EXPECT_THAT(stated, IsOk());
  if (!stated.ok()) return solved;
  std::vector<RigidTransform> poses;
  std::vector<Eigen::Vector3d> sigma_m;
  for (size_t c = 0; c < 4; ++c) {
    poses.push_back(solution->built.problem.cameras[c].cam_from_rig);
    sigma_m.push_back(stated->cameras[c].position_sigma_m);
  }
  solved.design_effect = stated->design_effect;
  solved.mean_square = MeanSquare(worlds.front(), poses, sigma_m);
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

// The general path has the same, of a rigid target and of two targets. Fifteen blocks of 18
// parameters: the design effect scatters by a tenth to a fifth.
TEST(BlockScatter, OfRigidAndMixedTargets) {
  for (const std::vector<Target>& targets :
       {std::vector<Target>{BodyTarget(0)}, std::vector<Target>{WandTarget(), BodyTarget(0)}}) {
    double independent = 0, common = 0, mean_square = 0;
    constexpr int kSeeds = 4;
    for (uint32_t seed = 1; seed <= kSeeds; ++seed) {
      independent += SolveOnce(seed, 0, targets).design_effect / kSeeds;
      const Solved solved = SolveOnce(seed, 0.6, targets);
      common += solved.design_effect / kSeeds;
      mean_square += solved.mean_square / kSeeds;
    }
    EXPECT_GT(independent, 0.75);
    EXPECT_LT(independent, 1.25);
    EXPECT_GT(common, 4);
    // 36 values that share the reference camera's errors and those of the scale: wide limits.
    EXPECT_GT(mean_square, 0.3);
    EXPECT_LT(mean_square, 3);
  }
}

}  // namespace
}  // namespace rigcal::server::block_scatter_test
