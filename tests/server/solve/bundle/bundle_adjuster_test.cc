// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/bundle_adjuster.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "server/solve/bundle/marker_residual_px.h"
#include "tests/server/solve/exact_problem.h"
#include "tests/testing/bundle_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::bundle_adjuster_test {
namespace {

using ::rigcal::testing::BundleScene;
using ::rigcal::testing::BundleSceneOptions;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::MakeBundleScene;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

BundleSceneOptions Exact() {
  BundleSceneOptions options;
  options.instant_count = 20;
  options.noise_px = 0;
  return options;
}

void ExpectSamePoses(const BundleProblem& a, const BundleProblem& b, double tolerance) {
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    const RigidTransform &left = a.cameras[c].cam_from_rig, &right = b.cameras[c].cam_from_rig;
    EXPECT_LE((left.translation_m - right.translation_m).norm(), tolerance) << c;
    EXPECT_LE(left.rotation.angularDistance(right.rotation), tolerance) << c;
  }
}

TEST(SolveBundle, FindsTheGroundTruthOfExactViews) {
  const BundleScene scene = MakeBundleScene(Exact());
  BundleProblem problem = scene.initial;
  ASSERT_OK_AND_ASSIGN(const BundleSummary summary, SolveBundle({}, &problem));
  EXPECT_TRUE(summary.converged);
  EXPECT_GT(summary.initial_cost, 1);
  EXPECT_LT(summary.final_cost, 1e-6);
  ExpectSamePoses(problem, scene.ground_truth, 1e-6);
  for (size_t k = 0; k < problem.clocks.size(); ++k) {
    EXPECT_NEAR(problem.clocks[k].time_offset_s, scene.ground_truth.clocks[k].time_offset_s, 1e-7);
  }
}

TEST(SolveBundle, MovesNothingThatIsFixed) {
  BundleSceneOptions options = Exact();
  options.noise_px = 0.5;
  BundleProblem problem = MakeBundleScene(options).initial;
  problem.cameras[2].pose_fixed = true;
  problem.clocks[3].offset_fixed = true;
  problem.clocks[3].time_offset_s = 0.002;
  const BundleProblem before = problem;
  ASSERT_THAT(SolveBundle({}, &problem), IsOk());
  for (const size_t c : {0, 2}) {
    EXPECT_EQ(problem.cameras[c].cam_from_rig.translation_m,
              before.cameras[c].cam_from_rig.translation_m);
    EXPECT_LT(problem.cameras[c].cam_from_rig.rotation.angularDistance(
                  before.cameras[c].cam_from_rig.rotation),
              1e-7);
  }
  EXPECT_NE(problem.cameras[1].cam_from_rig.translation_m,
            before.cameras[1].cam_from_rig.translation_m);
  EXPECT_EQ(problem.clocks[3].time_offset_s, 0.002);
  EXPECT_NE(problem.clocks[1].time_offset_s, 0);
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    EXPECT_EQ(problem.cameras[c].intrinsics, before.cameras[c].intrinsics);
    EXPECT_EQ(problem.clocks[c].time_rate, before.clocks[c].time_rate);
  }
  EXPECT_EQ(problem.target.marker_positions_m, before.target.marker_positions_m);
}

TEST(SolveBundle, HoldsIntrinsicsWithoutASigma) {
  BundleSceneOptions options = Exact();
  options.noise_px = 0.5;
  options.free_intrinsics = true;
  BundleProblem problem = MakeBundleScene(options).initial;
  problem.cameras[2].intrinsics_sigma.setZero();  // all of them
  const BundleProblem before = problem;
  ASSERT_THAT(SolveBundle({}, &problem), IsOk());
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    for (Eigen::Index i = 0; i < problem.cameras[c].intrinsics.size(); ++i) {
      const bool held = before.cameras[c].intrinsics_sigma[i] == 0;
      EXPECT_EQ(problem.cameras[c].intrinsics[i] == before.cameras[c].intrinsics[i], held)
          << c << " " << i;
    }
  }
}

TEST(SolveBundle, ReturnsUnitRotationsAndDirections) {
  BundleProblem problem = MakeBundleScene(Exact()).initial;
  problem.cameras[1].cam_from_rig.rotation.coeffs() *= 1.001;
  ASSERT_THAT(SolveBundle({}, &problem), IsOk());
  for (const BundleCamera& camera : problem.cameras) {
    EXPECT_NEAR(camera.cam_from_rig.rotation.norm(), 1, 1e-14);
  }
  for (const BundleInstant& instant : problem.instants) {
    EXPECT_NEAR(instant.direction.norm(), 1, 1e-14);
  }
}

// One marker 30 sigmas off, at poses that are all true: what it costs is the loss alone.
double CostOfOneOutlier(bool robust, double loss_scale) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {{{0, 0, 4}}});
  problem.cameras[1].pose_fixed = true;
  problem.markers[1].centre_px += Eigen::Vector2d(18, 24);
  BundleOptions options;
  options.robust = robust;
  options.loss_scale = loss_scale;
  options.max_iterations = 0;
  const absl::StatusOr<BundleSummary> summary = SolveBundle(options, &problem);
  EXPECT_THAT(summary, IsOk());
  return summary.ok() ? summary->initial_cost : kNaN;
}

TEST(SolveBundle, AppliesTheLossToEachMarker) {
  EXPECT_NEAR(CostOfOneOutlier(false, 2), 0.5 * 900, 1e-6);
  EXPECT_NEAR(CostOfOneOutlier(true, 2), 0.5 * 4 * std::log1p(900 / 4.0), 1e-6);
  EXPECT_NEAR(CostOfOneOutlier(true, 5), 0.5 * 25 * std::log1p(900 / 25.0), 1e-6);
}

TEST(SolveBundle, ARobustLossKeepsThePosesOutliersWouldMove) {
  BundleSceneOptions scene_options = Exact();
  scene_options.noise_px = 0.1;
  scene_options.instant_count = 60;
  scene_options.outlier_share = 0.05;
  const BundleScene scene = MakeBundleScene(scene_options);
  const auto worst_m = [&scene](bool robust) {
    BundleProblem problem = scene.initial;
    BundleOptions options;
    options.robust = robust;
    EXPECT_THAT(SolveBundle(options, &problem), IsOk());
    double worst = 0;
    for (size_t c = 0; c < problem.cameras.size(); ++c) {
      worst = std::max(worst, (problem.cameras[c].cam_from_rig.translation_m -
                               scene.ground_truth.cameras[c].cam_from_rig.translation_m)
                                  .norm());
    }
    return worst;
  };
  EXPECT_LT(worst_m(true), 0.005);
  EXPECT_GT(worst_m(false), 0.05);
}

TEST(SolveBundle, WeighsAnOffsetByItsPrior) {
  // One fixed camera, its wand fixed by another one; camera 1's clock is 10 ms off by its views.
  const auto offset_s = [](double sigma_s) {
    BundleSceneOptions options = Exact();
    options.free_poses = false;
    options.initial_error = 0;
    BundleProblem problem = MakeBundleScene(options).ground_truth;
    problem.clocks[1].prior_offset_s = 0.5;
    problem.clocks[1].offset_sigma_s = sigma_s;
    EXPECT_THAT(SolveBundle({}, &problem), IsOk());
    return problem.clocks[1].time_offset_s;
  };
  const double free_s = offset_s(0);
  EXPECT_NEAR(offset_s(100), free_s, 1e-6);
  EXPECT_GT(offset_s(1e-4), free_s + 1e-5);
  EXPECT_NEAR(offset_s(1e-9), 0.5, 1e-3);
}

TEST(SolveBundle, HoldsTheFirstMarkerAndPullsSpansTowardsTheGivenOnes) {
  BundleSceneOptions options = Exact();
  options.free_spacing = true;
  BundleProblem problem = MakeBundleScene(options).initial;
  problem.target.given_positions_m = {0, 0.14, 0.41};
  problem.target.span_sigma_m = 1e-7;
  ASSERT_THAT(SolveBundle({}, &problem), IsOk());
  EXPECT_EQ(problem.target.marker_positions_m[0], 0);
  EXPECT_NEAR(problem.target.marker_positions_m[1], 0.14, 1e-5);
  EXPECT_NEAR(problem.target.marker_positions_m[2], 0.41, 1e-5);
}

TEST(SolveBundle, EqualProblemsGiveEqualBitsWhereverTheirMemoryLies) {
  BundleSceneOptions options = Exact();
  options.noise_px = 0.5;
  options.outlier_share = 0.05;
  options.free_intrinsics = true;
  options.free_spacing = true;
  const BundleProblem start = MakeBundleScene(options).initial;
  BundleProblem first = start;
  ASSERT_OK_AND_ASSIGN(const BundleSummary summary, SolveBundle({}, &first));
  std::vector<std::unique_ptr<std::vector<char>>> in_the_way;
  for (size_t round = 1; round < 4; ++round) {
    for (size_t size = 16; size < 40'000; size += 400 * round + 8) {
      in_the_way.push_back(std::make_unique<std::vector<char>>(size));
    }
    for (size_t i = 0; i < in_the_way.size(); i += round + 1) in_the_way[i].reset();
    BundleProblem again = start;
    ASSERT_OK_AND_ASSIGN(const BundleSummary other, SolveBundle({}, &again));
    EXPECT_EQ(summary.final_cost, other.final_cost);
    EXPECT_EQ(summary.iterations, other.iterations);
    for (size_t c = 0; c < first.cameras.size(); ++c) {
      EXPECT_EQ(first.cameras[c].cam_from_rig.rotation.coeffs(),
                again.cameras[c].cam_from_rig.rotation.coeffs());
      EXPECT_EQ(first.cameras[c].cam_from_rig.translation_m,
                again.cameras[c].cam_from_rig.translation_m);
      EXPECT_EQ(first.cameras[c].intrinsics, again.cameras[c].intrinsics);
    }
    for (size_t i = 0; i < first.instants.size(); ++i) {
      EXPECT_EQ(first.instants[i].origin_m, again.instants[i].origin_m);
    }
  }
}

TEST(SolveBundle, LeavesUnusedInstantsAndMarkersOut) {
  BundleSceneOptions options = Exact();
  const BundleScene scene = MakeBundleScene(options);
  BundleProblem problem = scene.initial;
  problem.instants[4].used = false;
  problem.instants[4].origin_m = {0, 0, -50};
  BundleMarker& outlier = problem.markers[7];
  outlier.used = false;
  outlier.centre_px = {1e6, -1e6};
  ASSERT_THAT(SolveBundle({}, &problem), IsOk());
  ExpectSamePoses(problem, scene.ground_truth, 1e-6);
  EXPECT_EQ(problem.instants[4].origin_m, Eigen::Vector3d(0, 0, -50));
}

TEST(SolveBundle, NothingToSolveIsAnError) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {{{0, 0, 4}}});
  problem.instants[0].used = false;
  EXPECT_THAT(SolveBundle({}, &problem),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("no marker is used")));
  BundleProblem empty;
  EXPECT_THAT(SolveBundle({}, &empty), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("")));
}

TEST(SolveBundle, AMarkerBehindItsCameraIsAnErrorThatMovesNothing) {
  BundleProblem problem = MakeBundleScene(Exact()).initial;
  problem.instants[3].origin_m =
      problem.cameras[1].cam_from_rig.Inverse() * Eigen::Vector3d(0, 0, -1);
  const BundleProblem before = problem;
  EXPECT_THAT(SolveBundle({}, &problem),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("bundle adjustment")));
  ExpectSamePoses(problem, before, 0);
}

TEST(SolveBundle, StopsWhenCancelledAndMovesNothing) {
  BundleProblem problem = MakeBundleScene(Exact()).initial;
  const BundleProblem before = problem;
  std::atomic<bool> cancelled = false;
  BundleOptions options;
  options.cancelled = &cancelled;
  options.progress = [&cancelled](int iteration, double) { cancelled = iteration >= 1; };
  EXPECT_THAT(SolveBundle(options, &problem),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("")));
  ExpectSamePoses(problem, before, 0);
}

TEST(SolveBundle, RunningOutOfIterationsIsNoError) {
  BundleProblem problem = MakeBundleScene(Exact()).initial;
  BundleOptions options;
  options.max_iterations = 1;
  ASSERT_OK_AND_ASSIGN(const BundleSummary summary, SolveBundle(options, &problem));
  EXPECT_FALSE(summary.converged);
  EXPECT_LT(summary.final_cost, summary.initial_cost);
}

// ---- what is not valid ----

TEST(BundleProblemValidate, RefusesEveryFault) {
  const std::vector<std::pair<const char*, std::function<void(BundleProblem&)>>> faults = {
      {"NaN translation", [](auto& p) { p.cameras[1].cam_from_rig.translation_m.x() = kNaN; }},
      {"NaN rotation", [](auto& p) { p.cameras[1].cam_from_rig.rotation.x() = kNaN; }},
      {"NaN intrinsics", [](auto& p) { p.cameras[1].intrinsics[3] = kNaN; }},
      {"too few intrinsics", [](auto& p) { p.cameras[1].intrinsics = IntrinsicsVector::Ones(4); }},
      {"no prior", [](auto& p) { p.cameras[1].intrinsics_fixed = false; }},
      {"no fixed camera", [](auto& p) { p.cameras[0].pose_fixed = false; }},
      {"no fixed clock", [](auto& p) { p.clocks[0].offset_fixed = false; }},
      {"no fixed rate", [](auto& p) { p.clocks[0].rate_fixed = false; }},
      {"NaN offset", [](auto& p) { p.clocks[0].time_offset_s = kNaN; }},
      {"NaN rate", [](auto& p) { p.clocks[0].time_rate = kNaN; }},
      {"NaN position", [](auto& p) { p.target.marker_positions_m[1] = kNaN; }},
      {"no given spacing",
       [](auto& p) {
         p.target.fixed = false;
         p.target.given_positions_m.pop_back();
       }},
      {"no tolerance of the spacing",
       [](auto& p) {
         p.target.fixed = false;
         p.target.span_sigma_m = 0;
       }},
      {"NaN origin", [](auto& p) { p.instants[0].origin_m.y() = kNaN; }},
      {"NaN direction", [](auto& p) { p.instants[0].direction.y() = kNaN; }},
      {"long direction", [](auto& p) { p.instants[0].direction *= 1.01; }},
      {"zero direction", [](auto& p) { p.instants[0].direction.setZero(); }},
      {"observations", [](auto& p) { p.instants[0].observation_count = 3; }},
      {"first observation", [](auto& p) { p.instants[0].first_observation = -1; }},
      {"camera", [](auto& p) { p.observations[1].camera = 2; }},
      {"camera below 0", [](auto& p) { p.observations[1].camera = -1; }},
      {"clock", [](auto& p) { p.observations[1].clock = 1; }},
      {"markers", [](auto& p) { p.observations[1].marker_count = 4; }},
      {"marker", [](auto& p) { p.markers[5].marker = 3; }},
      {"marker below 0", [](auto& p) { p.markers[5].marker = -1; }},
      {"NaN centre", [](auto& p) { p.markers[5].centre_px.x() = kNaN; }},
      {"NaN velocity", [](auto& p) { p.markers[5].velocity_px_s.x() = kNaN; }},
      {"NaN information", [](auto& p) { p.markers[5].sqrt_information(1, 0) = kNaN; }},
      {"run beyond int",
       [](auto& p) {
         p.instants[0].first_observation = std::numeric_limits<int>::max();
         p.instants[0].observation_count = std::numeric_limits<int>::max();
       }},
  };
  const BundleProblem valid = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {{{0, 0, 4}}});
  ASSERT_THAT(valid.Validate(), IsOk());
  for (const auto& [what, spoil] : faults) {
    BundleProblem problem = valid;
    spoil(problem);
    EXPECT_THAT(problem.Validate(),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("bundle adjustment")))
        << what;
    EXPECT_THAT(SolveBundle({}, &problem),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("bundle adjustment")))
        << what;
  }
}

TEST(BundleOptionsValidate, RefusesValuesThatAreNotPositive) {
  for (double BundleOptions::*value :
       {&BundleOptions::loss_scale, &BundleOptions::function_tolerance,
        &BundleOptions::gradient_tolerance, &BundleOptions::parameter_tolerance,
        &BundleOptions::initial_radius}) {
    for (const double bad : {0.0, -1.0, kNaN, std::numeric_limits<double>::infinity()}) {
      BundleOptions options;
      options.*value = bad;
      EXPECT_THAT(options.Validate(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("")))
          << bad;
    }
  }
  BundleOptions options;
  options.max_iterations = -1;
  EXPECT_THAT(options.Validate(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("")));
}

// ---- the residual alone ----

TEST(MarkerResidualPx, IsProjectionMinusCentreAtTheRightTime) {
  BundleProblem problem = ExactProblem({{0, 0, 0}}, {{{0, 0, 4}}});
  problem.clocks[0].time_offset_s = 0.01;
  BundleMarker marker = problem.markers[0];
  marker.velocity_px_s = {100, 0};
  marker.centre_px += Eigen::Vector2d(3, -2);
  marker.used = false;
  const auto residual =
      MarkerResidualPx(problem, problem.instants[0], problem.observations[0], marker);
  ASSERT_TRUE(residual);
  EXPECT_NEAR(residual->x(), -3 + 1, 1e-9);
  EXPECT_NEAR(residual->y(), 2, 1e-9);
}

TEST(MarkerResidualPx, IsNoneBehindTheCameraOrWhereNothingIsFinite) {
  BundleProblem problem = ExactProblem({{0, 0, 0}}, {{{0, 0, 4}}});
  for (const double z : {-4.0, 0.0, kNaN}) {
    problem.instants[0].origin_m.z() = z;
    EXPECT_FALSE(
        MarkerResidualPx(problem, problem.instants[0], problem.observations[0], problem.markers[0]))
        << z;
  }
}

}  // namespace
}  // namespace rigcal::server::bundle_adjuster_test
