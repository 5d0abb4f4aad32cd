// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/marker_residual.h"

#include <gtest/gtest.h>

#include <vector>

#include "server/solve/bundle/bundle_adjuster.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/bundle/marker_cost.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "tests/bench/reference_bundle.h"
#include "tests/testing/bundle_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::marker_residual_test {
namespace {

using ::rigcal::testing::IsOk;

// All lens models, clocks with offsets and rates, nothing free that has a prior.
BundleProblem Problem() {
  testing::BundleSceneOptions scene = testing::SmallBundleScene();
  scene.free_offsets = scene.free_rates = scene.free_intrinsics = scene.free_spacing = false;
  BundleProblem problem = testing::MakeBundleScene(scene).initial;
  for (size_t k = 0; k < problem.clocks.size(); ++k) {
    problem.clocks[k].time_offset_s = 0.002 * static_cast<double>(k);
    problem.clocks[k].time_rate = 1e-5 * static_cast<double>(k);
  }
  return problem;
}

double SumOfSquares(const BundleProblem& problem) {
  double sum = 0;
  for (const BundleInstant& instant : problem.instants) {
    ForEachUsedMarker(
        problem, instant, [&](const BundleObservation& observation, const BundleMarker& marker) {
          const auto residual_px = MarkerResidualPx(problem, instant, observation, marker);
          ASSERT_TRUE(residual_px);
          sum += (marker.sqrt_information * *residual_px).squaredNorm();
        });
  }
  return sum;
}

TEST(MarkerResidual, GivesEveryUserTheSameCost) {
  const BundleProblem problem = Problem();
  const double expected = 0.5 * SumOfSquares(problem);
  ASSERT_GT(expected, 0);
  BundleOptions options;
  options.robust = false;
  options.max_iterations = 1;
  BundleProblem kernel = problem, ceres = problem, reference = problem;
  ASSERT_OK_AND_ASSIGN(const BundleSummary by_kernel, SolveLineBundle(options, &kernel));
  ASSERT_OK_AND_ASSIGN(const BundleSummary by_ceres, SolveBundle(options, &ceres));
  ASSERT_OK_AND_ASSIGN(const BundleSummary by_reference,
                       testing::SolveReferenceBundle(options, &reference));
  EXPECT_NEAR(by_kernel.initial_cost, expected, 1e-12 * expected);
  EXPECT_NEAR(by_ceres.initial_cost, expected, 1e-12 * expected);
  EXPECT_NEAR(by_reference.initial_cost, expected, 1e-12 * expected);
}

TEST(MarkerResidual, HasAnUpperTriangleOfTheSameInformation) {
  for (const Eigen::Matrix2d& root : {(Eigen::Matrix2d() << 2, 0.3, -0.7, 1.7).finished(),
                                      (Eigen::Matrix2d() << -2, 0.3, 0, -1.7).finished(),
                                      (Eigen::Matrix2d() << 0, 0.3, 0, 1.7).finished()}) {
    BundleMarker marker;
    marker.sqrt_information = root;
    const MeasuredMarker<double> measured = ToMeasured(marker);
    Eigen::Matrix2d upper;
    upper << measured.a, measured.b, 0, measured.c;
    EXPECT_LT((upper.transpose() * upper - root.transpose() * root).norm(), 1e-12);
    EXPECT_GE(measured.a, 0);
    EXPECT_GE(measured.c, 0);
  }
}

}  // namespace
}  // namespace rigcal::server::marker_residual_test
