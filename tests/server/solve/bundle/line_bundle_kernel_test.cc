// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle_kernel.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <random>
#include <vector>

#include "server/solve/bundle/line_bundle_projection.h"
#include "server/solve/bundle/line_bundle_system.h"
#include "server/solve/bundle/projection_jacobian.h"
#include "tests/testing/bundle_scene.h"

namespace rigcal::server::line_bundle_kernel_test {
namespace {

struct ModelCase {
  DistortionModel model;
  KernelModel kernel_model;
  IntrinsicsVector intrinsics;
};

std::vector<ModelCase> AllModels() {
  std::vector<ModelCase> cases(3);
  cases[0] = {DistortionModel::kBrownConrady, KernelModel::kBrownConrady, IntrinsicsVector(9)};
  cases[0].intrinsics << 1010, 990, 633, 517, -0.21, 0.11, 1e-3, -2e-3, 0.03;
  cases[1] = {DistortionModel::kRational, KernelModel::kRational, IntrinsicsVector(12)};
  cases[1].intrinsics << 1010, 990, 633, 517, 0.21, -0.11, 1e-3, -2e-3, 0.03, 0.3, -0.05, 0.02;
  cases[2] = {DistortionModel::kFisheye, KernelModel::kFisheye, IntrinsicsVector(8)};
  cases[2].intrinsics << 610, 590, 633, 517, -0.02, 0.01, -3e-3, 1e-3;
  return cases;
}

ProjectedPoint<double> ProjectAll(const ModelCase& camera, const Eigen::Vector3d& point,
                                  const IntrinsicsVector& intrinsics) {
  const double x_in_cam[3] = {point.x(), point.y(), point.z()};
  ProjectedPoint<double> projected;
  ProjectWith<true, true>(camera.kernel_model, intrinsics.data(), x_in_cam, &projected);
  return projected;
}

TEST(LineBundleProjection, AgreesWithTheProjectionOfTheReference) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> side(-1.2, 1.2), depth(0.5, 5);
  for (const ModelCase& camera : AllModels()) {
    for (int i = 0; i < 200; ++i) {
      const double z = depth(random);
      const Eigen::Vector3d point = i == 0 ? Eigen::Vector3d(0, 0, z)
                                           : Eigen::Vector3d(z * side(random), z * side(random), z);
      const ProjectedPoint<double> mine = ProjectAll(camera, point, camera.intrinsics);
      Eigen::Vector2d pixel;
      Eigen::Matrix<double, 2, 3> d_point;
      IntrinsicsJacobian d_intrinsics;
      ASSERT_TRUE(ProjectWithJacobian(camera.model, camera.intrinsics.data(), point, &pixel,
                                      &d_point, &d_intrinsics));
      for (int r = 0; r < 2; ++r) {
        EXPECT_NEAR(mine.pixel[r], pixel[r], 1e-9);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(mine.d_point[r][c], d_point(r, c), 1e-8);
        for (int c = 0; c < d_intrinsics.cols(); ++c) {
          EXPECT_NEAR(mine.d_intrinsics[r][c], d_intrinsics(r, c), 1e-8);
        }
      }
    }
  }
}

TEST(LineBundleProjection, AgreesWithDifferences) {
  const double step = 1e-6;
  for (const ModelCase& camera : AllModels()) {
    const Eigen::Vector3d point(0.7, -0.4, 1.9);
    const ProjectedPoint<double> at = ProjectAll(camera, point, camera.intrinsics);
    for (int c = 0; c < 3; ++c) {
      const Eigen::Vector3d delta = step * Eigen::Vector3d::Unit(c);
      const auto plus = ProjectAll(camera, point + delta, camera.intrinsics);
      const auto minus = ProjectAll(camera, point - delta, camera.intrinsics);
      for (int r = 0; r < 2; ++r) {
        EXPECT_NEAR(at.d_point[r][c], (plus.pixel[r] - minus.pixel[r]) / (2 * step), 1e-5);
      }
    }
    for (int c = 0; c < camera.intrinsics.size(); ++c) {
      IntrinsicsVector more = camera.intrinsics, less = camera.intrinsics;
      more[c] += step, less[c] -= step;
      const auto plus = ProjectAll(camera, point, more), minus = ProjectAll(camera, point, less);
      for (int r = 0; r < 2; ++r) {
        EXPECT_NEAR(at.d_intrinsics[r][c], (plus.pixel[r] - minus.pixel[r]) / (2 * step), 1e-5);
      }
    }
  }
}

TEST(LineBundleProjection, SaysWhatLiesBeyondAPole) {
  ModelCase camera = AllModels()[1];
  camera.intrinsics.tail<3>() << -1, 0, 0;  // the denominator is 1 - r^2
  EXPECT_GT(ProjectAll(camera, {0.9, 0, 1}, camera.intrinsics).visible, 0);
  EXPECT_LE(ProjectAll(camera, {1.1, 0, 1}, camera.intrinsics).visible, 0);
}

struct OneStep {
  Eigen::MatrixXd matrix;
  double cost = 0;
  LineBundleSystem::Move move;
};

OneStep StepWith(const LineBundleKernel& kernel, const BundleOptions& options,
                 const BundleProblem& problem) {
  LineBundleLayout layout = LayOut(problem);
  const PackedMarkers packed = Pack(problem, &layout);
  LineBundleTimes times;
  LineBundleSystem system(options, layout, packed, kernel, &times);
  LineBundleEstimate estimate(problem, layout, packed), moved(problem, layout, packed);
  OneStep step;
  EXPECT_TRUE(system.Linearise(estimate, 1e-4));
  step.cost = system.cost();
  step.matrix = system.matrix().triangularView<Eigen::Lower>();
  step.move = system.Solve(estimate, &moved);
  if (step.move.valid) {
    EXPECT_EQ(system.Cost(moved), step.move.cost);
  }
  return step;
}

TEST(LineBundleKernel, GivesTheSameBitsWithEveryInstructionSet) {
  const auto kernels = AvailableLineBundleKernels();
  ASSERT_FALSE(kernels.empty());
  for (const BundleLoss loss : {BundleLoss::kNone, BundleLoss::kHuber, BundleLoss::kCauchy}) {
    testing::BundleSceneOptions scene_options;
    scene_options.camera_count = 7;
    scene_options.instant_count = 150;  // several batches, the last one not full
    scene_options.models = {DistortionModel::kBrownConrady, DistortionModel::kFisheye,
                            DistortionModel::kRational};
    scene_options.outlier_share = loss == BundleLoss::kNone ? 0 : 0.1;
    scene_options.hidden_share = 0.2;
    scene_options.free_rates = scene_options.free_intrinsics = scene_options.free_spacing = true;
    const BundleProblem problem = testing::MakeBundleScene(scene_options).start;
    BundleOptions options;
    options.loss = loss;
    const OneStep plain = StepWith(*kernels.front(), options, problem);
    EXPECT_TRUE(plain.move.valid);
    EXPECT_LT(plain.move.cost, plain.cost);
    for (const LineBundleKernel* kernel : kernels) {
      const OneStep step = StepWith(*kernel, options, problem);
      EXPECT_EQ(step.cost, plain.cost) << kernel->name;
      EXPECT_EQ(step.matrix, plain.matrix) << kernel->name;
      EXPECT_EQ(step.move.cost, plain.move.cost) << kernel->name;
      EXPECT_EQ(step.move.model_decrease, plain.move.model_decrease) << kernel->name;
    }
  }
}

TEST(LineBundleKernel, PredictsTheDecreaseOfASmallStep) {
  testing::BundleSceneOptions scene_options;
  scene_options.free_rates = scene_options.free_intrinsics = scene_options.free_spacing = true;
  scene_options.start_error = 1e-3;
  BundleProblem problem = testing::MakeBundleScene(scene_options).truth;
  BundleOptions options;
  options.loss = BundleLoss::kNone;
  const OneStep step = StepWith(BestLineBundleKernel(), options, problem);
  // Without a loss and near the optimum the model is the cost, so any wrong derivative shows.
  EXPECT_NEAR(step.cost - step.move.cost, step.move.model_decrease,
              1e-3 * step.move.model_decrease);
}

}  // namespace
}  // namespace rigcal::server::line_bundle_kernel_test
