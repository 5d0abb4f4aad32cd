// SPDX-License-Identifier: Apache-2.0
// Rigs of which each instant is seen by few cameras: their order, and the system that is kept
// within its envelope, against the general path, which is not.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <vector>

#include "server/solve/bundle/bundle_adjuster.h"
#include "server/solve/bundle/bundle_information.h"
#include "server/solve/bundle/camera_order.h"
#include "server/solve/bundle/envelope_matrix.h"
#include "server/solve/bundle/line_bundle.h"
#include "tests/testing/bundle_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server {
namespace {

constexpr int kCameras = 60, kReach = 3;

// A camera's place in the hall: they are numbered as a shuffled deck.
int PlaceOf(int camera) { return camera * 37 % kCameras; }

// The target goes through the hall; the cameras within reach see it.
BundleProblem MakeHall(int clock_count, bool free_intrinsics) {
  testing::BundleSceneOptions options;
  options.camera_count = kCameras;
  options.instant_count = 250;
  options.clock_count = clock_count;
  options.free_spacing = true;
  options.free_intrinsics = free_intrinsics;
  BundleProblem problem = testing::MakeBundleScene(options).ground_truth;
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    const BundleInstant& instant = problem.instants[i];
    const int place = static_cast<int>(i * kCameras / problem.instants.size());
    for (int o = 0; o < instant.observation_count; ++o) {
      const auto at = static_cast<size_t>(instant.first_observation + o);
      const BundleObservation& observation = problem.observations[at];
      if (std::abs(PlaceOf(observation.camera) - place) <= kReach) continue;
      for (int m = 0; m < observation.marker_count; ++m) {
        problem.markers[static_cast<size_t>(observation.first_marker + m)].used = false;
      }
    }
  }
  return problem;
}

TEST(CameraOrder, PutsCamerasThatShareInstantsNearEachOther) {
  const CameraOrder order = OrderCameras(MakeHall(0, true));
  EXPECT_TRUE(order.is_sparse);
  std::vector<int> sorted = order.cameras, all(kCameras);
  std::ranges::sort(sorted);
  std::iota(all.begin(), all.end(), 0);
  EXPECT_EQ(sorted, all);
  for (size_t i = 1; i < order.cameras.size(); ++i) {
    EXPECT_LE(std::abs(PlaceOf(order.cameras[i]) - PlaceOf(order.cameras[i - 1])), 2 * kReach);
  }
}

TEST(CameraOrder, LeavesSmallAndDenseRigsAsTheyAreNumbered) {
  for (const int cameras : {6, 30}) {
    testing::BundleSceneOptions options;
    options.camera_count = cameras;
    const CameraOrder order = OrderCameras(testing::MakeBundleScene(options).ground_truth);
    EXPECT_FALSE(order.is_sparse);
    EXPECT_TRUE(std::ranges::is_sorted(order.cameras));
    EXPECT_EQ(order.cameras.size(), static_cast<size_t>(cameras));
  }
}

TEST(CameraOrder, LeavesOutCamerasThatSeeNothing) {
  BundleProblem problem = MakeHall(0, true);
  for (const BundleObservation& observation : problem.observations) {
    if (observation.camera != 5) continue;
    for (int m = 0; m < observation.marker_count; ++m) {
      problem.markers[static_cast<size_t>(observation.first_marker + m)].used = false;
    }
  }
  const CameraOrder order = OrderCameras(problem);
  EXPECT_EQ(order.cameras.size(), static_cast<size_t>(kCameras - 1));
  EXPECT_EQ(std::ranges::count(order.cameras, 5), 0);
}

// Clocks of their own, and clocks that cameras all over the hall share.
TEST(SparseBundle, HasTheInformationOfTheGeneralPath) {
  for (const int clocks : {0, 3}) {
    const BundleProblem problem = MakeHall(clocks, true);
    ASSERT_OK_AND_ASSIGN(const ReducedInformation kernel,
                         ComputeReducedInformation(BundleOptions(), problem));
    ASSERT_OK_AND_ASSIGN(const ReducedInformation general,
                         ComputeGeneralInformation(BundleOptions(), problem));
    ASSERT_EQ(kernel.parameters, general.parameters);
    EXPECT_FALSE(EnvelopeMatrix(kernel.information).IsWhole()) << clocks << " clocks";
    const Eigen::VectorXd scale = general.information.diagonal().cwiseSqrt().cwiseInverse();
    EXPECT_LT((scale.asDiagonal() * (kernel.information - general.information) * scale.asDiagonal())
                  .cwiseAbs()
                  .maxCoeff(),
              1e-9);
  }
}

TEST(SparseBundle, ReachesTheOptimumOfTheGeneralPath) {
  BundleProblem by_kernel = MakeHall(0, false);
  for (size_t c = 1; c < by_kernel.cameras.size(); ++c) {
    by_kernel.cameras[c].cam_from_rig.translation_m.x() += 0.01;
  }
  BundleProblem by_ceres = by_kernel;
  ASSERT_OK_AND_ASSIGN(const BundleSummary mine,
                       SolveLineBundle(testing::TightTolerances(), &by_kernel));
  ASSERT_OK_AND_ASSIGN(const BundleSummary theirs,
                       SolveBundle(testing::TightTolerances(), &by_ceres));
  EXPECT_LT(mine.final_cost, 0.5 * mine.initial_cost);
  EXPECT_NEAR(mine.final_cost, theirs.final_cost, 1e-6 * theirs.final_cost);
}

}  // namespace
}  // namespace rigcal::server
