// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/lens_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "common/camera/camera_model.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/evaluate/placed_views.h"
#include "tests/testing/bundle_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::lens_fit_test {
namespace {

constexpr size_t kCameras = 8, kCamera = 3;
constexpr size_t kAll = 10'000;

// At the true values; only the centres have noise.
BundleProblem Scene() {
  testing::BundleSceneOptions options;
  options.camera_count = kCameras;
  options.instant_count = 150;
  return testing::MakeBundleScene(options).ground_truth;
}

std::vector<PlacedView> ViewsOf(const BundleProblem& problem, size_t camera) {
  return PlaceByOthers(problem, std::vector<bool>(problem.cameras.size(), true), kAll,
                       std::numeric_limits<double>::infinity())[camera];
}

// Its intrinsics are free, and were given `focal_factor` times as long as they are.
BundleCamera GivenTimes(double focal_factor, const BundleProblem& problem) {
  BundleCamera camera = problem.cameras[kCamera];
  camera.intrinsics.head<2>() *= focal_factor;
  camera.intrinsics_mean = camera.intrinsics;
  camera.intrinsics_sigma = IntrinsicsVector::Constant(camera.intrinsics.size(), 0.05);
  camera.intrinsics_sigma.head<2>() = 0.02 * camera.intrinsics.head<2>();
  camera.intrinsics_sigma.segment<2>(2).setConstant(10);
  camera.intrinsics_fixed = false;
  return camera;
}

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

TEST(PlaceByOthers, TheCameraItselfSaysNothingOfThePlaces) {
  BundleProblem problem = Scene();
  const std::vector<PlacedView> before = ViewsOf(problem, kCamera);
  for (BundleObservation& observation : problem.observations) {
    if (observation.camera != static_cast<int>(kCamera)) continue;
    for (BundleMarker& marker : problem.MarkersOf(observation)) marker.centre_px.x() += 3;
  }
  const std::vector<PlacedView> after = ViewsOf(problem, kCamera);
  ASSERT_EQ(before.size(), 150u);
  ASSERT_EQ(after.size(), before.size());
  for (size_t v = 0; v < before.size(); ++v) {
    for (size_t m = 0; m < before[v].x_in_rig.size(); ++m) {
      EXPECT_LT((after[v].x_in_rig[m] - before[v].x_in_rig[m]).norm(), 1e-9);
    }
  }
}

TEST(PlaceByOthers, PlacesAreThoseOfASolveWithoutTheCamera) {
  BundleProblem problem = Scene();
  for (BundleCamera& camera : problem.cameras) camera.pose_fixed = true;
  for (BundleClock& clock : problem.clocks) clock.offset_fixed = clock.rate_fixed = true;
  ASSERT_THAT(SolveLineBundle(testing::TightTolerances(), &problem), testing::IsOk());
  BundleProblem without = problem;
  for (BundleObservation& observation : without.observations) {
    if (observation.camera != static_cast<int>(kCamera)) continue;
    for (BundleMarker& marker : without.MarkersOf(observation)) marker.used = false;
  }
  ASSERT_THAT(SolveLineBundle(testing::TightTolerances(), &without), testing::IsOk());
  double moved_m2 = 0, left_m2 = 0;
  for (const PlacedView& view : ViewsOf(problem, kCamera)) {
    for (size_t m = 0; m < view.x_in_rig.size(); ++m) {
      BundleMarker marker;
      marker.marker = static_cast<int>(m);
      const Eigen::Vector3d all_m = problem.PointOf(problem.instants[view.instant], marker);
      const Eigen::Vector3d solved_m = without.PointOf(without.instants[view.instant], marker);
      moved_m2 += (solved_m - all_m).squaredNorm();
      left_m2 += (view.x_in_rig[m] - solved_m).squaredNorm();
    }
  }
  // The weights of the robust loss follow: three quarters of the way (0.248 is left here).
  EXPECT_GT(moved_m2, 0);
  EXPECT_LT(std::sqrt(left_m2 / moved_m2), 0.3);
}

// Against the same of the true places, which have no other error than the centres'.
TEST(PlaceByOthers, WhiteningAllowsForTheErrorOfThePlaces) {
  const BundleProblem problem = Scene();
  double squares = 0, count = 0, true_squares = 0, true_count = 0;
  for (size_t c = 0; c < kCameras; ++c) {
    const BundleCamera& camera = problem.cameras[c];
    for (const PlacedView& view : ViewsOf(problem, c)) {
      Eigen::VectorXd residual(view.whitening.rows());
      for (size_t m = 0; m < view.x_in_rig.size(); ++m) {
        Eigen::Vector2d pixel;
        ASSERT_TRUE(Project(camera.model, camera.intrinsics.data(),
                            camera.cam_from_rig * view.x_in_rig[m], &pixel, nullptr, nullptr));
        residual.segment<2>(static_cast<Eigen::Index>(2 * m)) = pixel - view.centre_px[m];
      }
      squares += (view.whitening * residual).squaredNorm();
      count += static_cast<double>(residual.size());
    }
  }
  for (const BundleInstant& instant : problem.instants) {
    ForEachUsedMarker(
        problem, instant, [&](const BundleObservation& observation, const BundleMarker& marker) {
          const auto residual = MarkerResidualPx(problem, instant, observation, marker);
          ASSERT_TRUE(residual);
          true_squares += (marker.sqrt_information * *residual).squaredNorm();
          true_count += 2;
        });
  }
  // By the weights of the robust loss the places are a little less certain than they are; without
  // their error it would be more than 1.1.
  const double ratio = squares / count / (true_squares / true_count);
  EXPECT_GT(ratio, 0.88);
  EXPECT_LT(ratio, 1.02);
}

TEST(PlaceByOthers, OneOtherCameraPlacesNothing) {
  BundleProblem problem = Scene();
  for (BundleObservation& observation : problem.observations) {
    if (observation.camera < 2) continue;
    for (BundleMarker& marker : problem.MarkersOf(observation)) marker.used = false;
  }
  EXPECT_TRUE(ViewsOf(problem, 0).empty());
  EXPECT_FALSE(ViewsOf(problem, 2).empty());
}

TEST(FitLens, FindsTheTrueFocalLengths) {
  const BundleProblem problem = Scene();
  LensFit fit;
  for (const bool from_afar : {false, true}) {
    ASSERT_TRUE(FitLens(ViewsOf(problem, kCamera), GivenTimes(1.01, problem),
                        {.from_afar = from_afar}, &fit));
    for (int i = 0; i < 2; ++i) {
      const double error_px = fit.camera.intrinsics[i] - problem.cameras[kCamera].intrinsics[i];
      EXPECT_GT(fit.IntrinsicSigma(i), 0.01);
      EXPECT_LT(std::abs(error_px), 4 * fit.IntrinsicSigma(i));
      EXPECT_LT(std::abs(error_px), 0.4 * 0.01 * problem.cameras[kCamera].intrinsics[i]);
    }
  }
}

TEST(FitLens, WithoutViewsThereIsNone) {
  const BundleProblem problem = Scene();
  LensFit fit;
  EXPECT_FALSE(FitLens({}, GivenTimes(1, problem), {}, &fit));
  EXPECT_TRUE(HeldOutErrorsPx({}, GivenTimes(1, problem), 4).empty());
  EXPECT_TRUE(HeldOutErrorsPx(ViewsOf(problem, kCamera), GivenTimes(1, problem), 0).empty());
}

TEST(HeldOutErrorsPx, RefinementPaysWhereGivenIntrinsicsAreWrongAlone) {
  const BundleProblem problem = Scene();
  const std::vector<PlacedView> views = ViewsOf(problem, kCamera);
  constexpr int kGroups = 12;
  for (const double factor : {1.0, 1.02}) {
    BundleCamera free = GivenTimes(factor, problem), fixed = free;
    fixed.intrinsics_fixed = true;
    const std::vector<double> refined = HeldOutErrorsPx(views, free, kGroups);
    const std::vector<double> given = HeldOutErrorsPx(views, fixed, kGroups);
    ASSERT_EQ(refined.size(), 12u);
    ASSERT_EQ(given.size(), 12u);
    if (factor == 1) {
      EXPECT_GT(Mean(refined), 0.99 * Mean(given));
    } else {
      EXPECT_LT(Mean(refined), 0.9 * Mean(given));
    }
  }
}

}  // namespace
}  // namespace rigcal::server::lens_fit_test
