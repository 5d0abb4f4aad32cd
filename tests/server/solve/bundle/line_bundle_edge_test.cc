// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include "common/camera/camera_model.h"
#include "server/solve/bundle/line_bundle.h"
#include "tests/bench/reference_bundle.h"
#include "tests/testing/bundle_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::line_bundle_edge_test {
namespace {

using ::rigcal::testing::BundleScene;
using ::rigcal::testing::BundleSceneOptions;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::MakeBundleScene;
using ::rigcal::testing::ReferenceCovariance;
using ::rigcal::testing::SmallBundleScene;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TightTolerances;
using ::testing::HasSubstr;

// ---- a marker behind its camera ----

TEST(LineBundleEdge, NamesAMarkerThatStartsBehindItsCamera) {
  BundleProblem problem = MakeBundleScene(SmallBundleScene()).initial;
  const RigidTransform& camera = problem.cameras[2].cam_from_rig;
  problem.instants[5].origin_m = camera.Inverse() * Eigen::Vector3d(0, 0, -1);
  const BundleProblem before = problem;
  EXPECT_THAT(SolveLineBundle({}, &problem),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       ::testing::AllOf(HasSubstr("instant 5"), HasSubstr("camera_2"))));
  EXPECT_EQ(problem.cameras[1].cam_from_rig.translation_m,
            before.cameras[1].cam_from_rig.translation_m);
}

TEST(LineBundleEdge, IgnoresAMarkerBehindItsCameraThatIsNotUsed) {
  BundleProblem problem = MakeBundleScene(SmallBundleScene()).initial;
  const RigidTransform& camera = problem.cameras[2].cam_from_rig;
  BundleInstant& instant = problem.instants[5];
  instant.origin_m = camera.Inverse() * Eigen::Vector3d(0, 0, -1);
  for (int o = 0; o < instant.observation_count; ++o) {
    const auto& observation =
        problem.observations[static_cast<size_t>(instant.first_observation + o)];
    for (int m = 0; m < observation.marker_count; ++m) {
      problem.markers[static_cast<size_t>(observation.first_marker + m)].used = false;
    }
  }
  ASSERT_OK_AND_ASSIGN(const BundleSummary summary, SolveLineBundle({}, &problem));
  EXPECT_TRUE(summary.converged);
}

// The other cameras measure an instant behind camera 1, which claims to see it: the plain step
// flies through the camera, and what counts is on which side it ends.
TEST(LineBundleEdge, NeverStepsBehindACamera) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.dropout_share = 0;
  BundleProblem problem = MakeBundleScene(scene_options).ground_truth;
  const RigidTransform rig_from_cam = problem.cameras[1].cam_from_rig.Inverse();
  BundleInstant& instant = problem.instants[5];
  instant.direction = rig_from_cam.rotation * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d behind = rig_from_cam * Eigen::Vector3d(0, 0, -0.3);
  for (int o = 0; o < instant.observation_count; ++o) {
    const auto& observation =
        problem.observations[static_cast<size_t>(instant.first_observation + o)];
    const BundleCamera& camera = problem.cameras[static_cast<size_t>(observation.camera)];
    for (int m = 0; m < observation.marker_count; ++m) {
      BundleMarker& marker = problem.markers[static_cast<size_t>(observation.first_marker + m)];
      const double position = problem.target.marker_positions_m[static_cast<size_t>(marker.marker)];
      marker.velocity_px_s.setZero();
      marker.centre_px = camera.intrinsics.segment<2>(2);
      if (observation.camera == 1) continue;
      Eigen::Vector2d centre_px;
      ASSERT_TRUE(Project(camera.model, camera.intrinsics.data(),
                          camera.cam_from_rig * (behind + position * instant.direction), &centre_px,
                          nullptr, nullptr));
      marker.centre_px = centre_px;
    }
  }
  instant.origin_m = rig_from_cam * Eigen::Vector3d(0, 0, 0.3);
  for (const bool robust : {false, true}) {
    BundleOptions options;
    options.robust = robust;
    BundleProblem solved = problem;
    ASSERT_OK_AND_ASSIGN(const BundleSummary summary, SolveLineBundle(options, &solved));
    EXPECT_LT(summary.final_cost, summary.initial_cost);
    EXPECT_GT((solved.cameras[1].cam_from_rig * solved.instants[5].origin_m).z(), 0);
    BundleProblem again = solved;  // a start out of sight would be refused
    EXPECT_THAT(SolveLineBundle(options, &again), IsOk());
  }
}

// ---- refusals and hooks ----

TEST(LineBundleEdge, RefusesWhatIsNotFinite) {
  const BundleProblem good = MakeBundleScene(SmallBundleScene()).initial;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<void (*)(BundleProblem*, double)> faults = {
      [](BundleProblem* p, double x) { p->cameras[1].cam_from_rig.translation_m.x() = x; },
      [](BundleProblem* p, double x) { p->cameras[1].intrinsics[5] = x; },
      [](BundleProblem* p, double x) { p->clocks[1].time_offset_s = x; },
      [](BundleProblem* p, double x) { p->target.marker_positions_m[1] = x; },
      [](BundleProblem* p, double x) { p->instants[2].origin_m.y() = x; },
      [](BundleProblem* p, double x) { p->markers[7].centre_px.y() = x; },
      [](BundleProblem* p, double x) { p->markers[7].velocity_px_s.x() = x; },
      [](BundleProblem* p, double x) { p->markers[7].sqrt_information(0, 1) = x; },
  };
  for (size_t i = 0; i < faults.size(); ++i) {
    for (const double value : {nan, std::numeric_limits<double>::infinity()}) {
      BundleProblem problem = good;
      faults[i](&problem, value);
      EXPECT_THAT(SolveLineBundle({}, &problem),
                  StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("finite")))
          << "fault " << i;
    }
  }
}

TEST(LineBundleEdge, RefusesWhatItCannotSolve) {
  const BundleProblem good = MakeBundleScene(SmallBundleScene()).initial;
  BundleProblem problem = good;
  for (BundleMarker& marker : problem.markers) marker.used = false;
  EXPECT_THAT(SolveLineBundle({}, &problem),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("no marker is used")));
  problem = good;
  problem.target.marker_positions_m.resize(33);
  EXPECT_THAT(SolveLineBundle({}, &problem),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("33")));
  problem = good;
  problem.target.fixed = false;
  problem.target.given_positions_m.clear();
  EXPECT_THAT(SolveLineBundle({}, &problem),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("spacing")));
  BundleOptions options;
  options.loss_scale = 0;
  problem = good;
  EXPECT_THAT(SolveLineBundle(options, &problem),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("loss scale")));
}

TEST(LineBundleEdge, StopsWhenCancelledAndLeavesTheProblemAlone) {
  const BundleProblem start = MakeBundleScene(SmallBundleScene()).initial;
  std::atomic<bool> cancelled = false;
  BundleOptions options = TightTolerances();
  options.cancelled = &cancelled;
  int calls = 0;
  options.progress = [&](int, double) { cancelled = ++calls == 3; };
  BundleProblem problem = start;
  EXPECT_THAT(SolveLineBundle(options, &problem),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("cancelled")));
  EXPECT_EQ(calls, 3);
  EXPECT_EQ(problem.instants[0].origin_m, start.instants[0].origin_m);
  EXPECT_EQ(problem.cameras[1].cam_from_rig.translation_m,
            start.cameras[1].cam_from_rig.translation_m);
}

TEST(LineBundleEdge, ReportsCostsThatNeverRise) {
  BundleProblem problem = MakeBundleScene(SmallBundleScene()).initial;
  BundleOptions options = TightTolerances();
  std::vector<double> costs;
  options.progress = [&](int iteration, double cost) {
    EXPECT_EQ(iteration, static_cast<int>(costs.size()) + 1);
    costs.push_back(cost);
  };
  ASSERT_OK_AND_ASSIGN(const BundleSummary summary, SolveLineBundle(options, &problem));
  ASSERT_FALSE(costs.empty());
  EXPECT_TRUE(std::is_sorted(costs.rbegin(), costs.rend()));
  EXPECT_EQ(costs.back(), summary.final_cost);
}

TEST(LineBundleEdge, SaysWhenIterationsAreUsedUp) {
  BundleProblem problem = MakeBundleScene(SmallBundleScene()).initial;
  BundleOptions options = TightTolerances();
  options.max_iterations = 1;
  ASSERT_OK_AND_ASSIGN(const BundleSummary summary, SolveLineBundle(options, &problem));
  EXPECT_FALSE(summary.converged);
  EXPECT_EQ(summary.iterations, 1);
  EXPECT_LT(summary.final_cost, summary.initial_cost);
}

// ---- information ----

TEST(ReducedInformation, InvertsToTheCovarianceOfCeres) {
  for (const bool robust : {false, true}) {
    BundleSceneOptions scene_options = SmallBundleScene();
    scene_options.free_rates = scene_options.free_intrinsics = scene_options.free_spacing = true;
    BundleProblem problem = MakeBundleScene(scene_options).initial;
    BundleOptions options = TightTolerances();
    options.robust = robust;
    ASSERT_THAT(SolveLineBundle(options, &problem), IsOk());
    ASSERT_OK_AND_ASSIGN(const ReducedInformation reduced,
                         ComputeReducedInformation(options, problem));
    ASSERT_OK_AND_ASSIGN(const Eigen::MatrixXd expected,
                         ReferenceCovariance(options, problem, reduced.parameters));
    const Eigen::MatrixXd covariance = reduced.information.inverse();
    const Eigen::VectorXd sigma = expected.diagonal().cwiseSqrt();
    const Eigen::MatrixXd difference = sigma.cwiseInverse().asDiagonal() * (covariance - expected) *
                                       sigma.cwiseInverse().asDiagonal();
    EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-5);
    EXPECT_EQ(reduced.information, reduced.information.transpose());
  }
}

TEST(ReducedInformation, DescribesEveryColumn) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.camera_count = 2;
  scene_options.free_rates = scene_options.free_spacing = true;
  const BundleProblem problem = MakeBundleScene(scene_options).initial;
  ASSERT_OK_AND_ASSIGN(const ReducedInformation reduced, ComputeReducedInformation({}, problem));
  using Kind = ReducedParameterKind;
  const std::vector<ReducedParameter> expected = {
      {Kind::kRotation, 1, 0},      {Kind::kRotation, 1, 1},    {Kind::kRotation, 1, 2},
      {Kind::kTranslation, 1, 0},   {Kind::kTranslation, 1, 1}, {Kind::kTranslation, 1, 2},
      {Kind::kTimeOffset, 1, 0},    {Kind::kTimeRate, 1, 0},    {Kind::kMarkerPosition, 1, 0},
      {Kind::kMarkerPosition, 2, 0}};
  EXPECT_EQ(reduced.parameters, expected);
  EXPECT_EQ(reduced.information.rows(), 10);
}

}  // namespace
}  // namespace rigcal::server::line_bundle_edge_test
