// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle_kernel.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <random>
#include <vector>

#include "common/camera/intrinsics_vector.h"
#include "server/solve/bundle/line_bundle_system.h"
#include "tests/testing/bundle_scene.h"

namespace rigcal::server::line_bundle_kernel_test {
namespace {

struct OneStep {
  Eigen::MatrixXd matrix;
  double cost = 0;
  LineBundleSystem::Move move;
};

OneStep StepWith(const LineBundleKernel& kernel, const BundleOptions& options,
                 const BundleProblem& problem, bool curved = false,
                 size_t max_packed_bytes = kMaxPackedBytes) {
  const LineBundleLayout layout = LayOut(problem);
  const PackedMarkers packed = Pack(problem, layout, max_packed_bytes);
  EXPECT_EQ(packed.source == nullptr, max_packed_bytes > 0);
  LineBundleSystem system(options, layout, packed, kernel);
  LineBundleEstimate estimate(problem, layout, packed), moved(problem, layout, packed);
  OneStep step;
  EXPECT_TRUE(system.Linearise(estimate, 1e-4, curved));
  step.cost = system.cost();
  step.matrix = system.matrix().Symmetric();
  step.move = system.Solve(estimate, &moved);
  if (step.move.valid) {
    EXPECT_EQ(system.Cost(moved), step.move.cost);
  }
  return step;
}

TEST(LineBundleKernel, GivesTheSameBitsWithEveryInstructionSet) {
  const auto kernels = AvailableLineBundleKernels();
  ASSERT_FALSE(kernels.empty());
  for (const bool robust : {false, true}) {
    testing::BundleSceneOptions scene_options;
    scene_options.camera_count = 7;
    scene_options.instant_count = 150;  // several batches, the last one not full
    scene_options.models = {DistortionModel::kBrownConrady, DistortionModel::kFisheye,
                            DistortionModel::kRational};
    scene_options.outlier_share = robust ? 0.1 : 0;
    scene_options.hidden_share = 0.2;
    scene_options.free_rates = scene_options.free_intrinsics = scene_options.free_spacing = true;
    const BundleProblem problem = testing::MakeBundleScene(scene_options).initial;
    BundleOptions options;
    options.robust = robust;
    const OneStep plain = StepWith(*kernels.front(), options, problem);
    EXPECT_TRUE(plain.move.valid);
    EXPECT_LT(plain.move.cost, plain.cost);
    // Data that is made group by group is the same data.
    const OneStep unpacked = StepWith(*kernels.front(), options, problem, false, 0);
    EXPECT_EQ(unpacked.cost, plain.cost);
    EXPECT_EQ(unpacked.matrix, plain.matrix);
    EXPECT_EQ(unpacked.move.cost, plain.move.cost);
    for (const bool curved : {false, true}) {
      const OneStep first = StepWith(*kernels.front(), options, problem, curved);
      EXPECT_EQ(first.matrix == plain.matrix, !curved || !robust);
      for (const LineBundleKernel* kernel : kernels) {
        const OneStep step = StepWith(*kernel, options, problem, curved);
        EXPECT_EQ(step.cost, first.cost) << kernel->name;
        EXPECT_EQ(step.matrix, first.matrix) << kernel->name;
        EXPECT_EQ(step.move.cost, first.move.cost) << kernel->name;
        EXPECT_EQ(step.move.model_decrease, first.move.model_decrease) << kernel->name;
      }
    }
  }
}

TEST(LineBundleKernel, PredictsTheDecreaseOfASmallStep) {
  testing::BundleSceneOptions scene_options;
  scene_options.free_rates = scene_options.free_intrinsics = scene_options.free_spacing = true;
  scene_options.initial_error = 1e-3;
  BundleProblem problem = testing::MakeBundleScene(scene_options).ground_truth;
  BundleOptions options;
  options.robust = false;
  const OneStep step = StepWith(BestLineBundleKernel(), options, problem);
  // Without a loss and near the optimum the model is the cost, so any wrong derivative shows.
  EXPECT_NEAR(step.cost - step.move.cost, step.move.model_decrease,
              1e-3 * step.move.model_decrease);
}

}  // namespace
}  // namespace rigcal::server::line_bundle_kernel_test
