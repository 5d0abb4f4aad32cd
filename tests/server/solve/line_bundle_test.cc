// SPDX-License-Identifier: Apache-2.0
#include "server/solve/line_bundle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "server/solve/projection_jacobian.h"
#include "tests/bench/reference_bundle.h"
#include "tests/testing/bundle_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server {
namespace {

using ::rigcal::testing::BundleScene;
using ::rigcal::testing::BundleSceneOptions;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::MakeBundleScene;
using ::rigcal::testing::ReferenceCovariance;
using ::rigcal::testing::SolveReferenceBundle;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

constexpr double kRelativeCost = 1e-9;  // what "the same optimum" means, by the issue

BundleOptions Tight() {
  BundleOptions options;
  options.max_iterations = 300;
  options.function_tolerance = 1e-14;
  options.gradient_tolerance = 1e-12;
  options.parameter_tolerance = 1e-14;
  return options;
}

BundleSceneOptions SmallScene() {
  BundleSceneOptions options;
  options.camera_count = 4;
  options.instant_count = 27;  // not a multiple of what goes side by side
  options.models = {DistortionModel::kBrownConrady, DistortionModel::kFisheye,
                    DistortionModel::kRational};
  options.dropout_share = 0.1;
  return options;
}

void ExpectSameEstimates(const BundleProblem& a, const BundleProblem& b) {
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    const RigidTransform difference =
        a.cameras[c].cam_from_rig * b.cameras[c].cam_from_rig.Inverse();
    EXPECT_LT(Eigen::AngleAxisd(difference.rotation).angle(), 1e-5) << "camera " << c;
    EXPECT_LT(difference.translation_m.norm(), 2e-5) << "camera " << c;
    EXPECT_LT((a.cameras[c].intrinsics - b.cameras[c].intrinsics).head<4>().norm(), 2e-2);
  }
  for (size_t k = 0; k < a.clocks.size(); ++k) {
    EXPECT_NEAR(a.clocks[k].time_offset_s, b.clocks[k].time_offset_s, 1e-6) << "clock " << k;
    EXPECT_NEAR(a.clocks[k].time_rate, b.clocks[k].time_rate, 1e-6) << "clock " << k;
  }
  for (size_t m = 0; m < a.target.marker_positions_m.size(); ++m) {
    EXPECT_NEAR(a.target.marker_positions_m[m], b.target.marker_positions_m[m], 1e-6);
  }
  for (size_t i = 0; i < a.instants.size(); ++i) {
    EXPECT_LT((a.instants[i].origin_m - b.instants[i].origin_m).norm(), 1e-4) << "instant " << i;
    EXPECT_NEAR(a.instants[i].direction.norm(), 1, 1e-12);
  }
}

// Solves with both; costs at the start and at the end must agree.
void ExpectReferenceOptimum(const BundleOptions& options, const BundleProblem& start,
                            BundleProblem* solved, BundleProblem* reference) {
  *solved = *reference = start;
  ASSERT_OK_AND_ASSIGN(const BundleSummary mine, SolveLineBundle(options, solved));
  ASSERT_OK_AND_ASSIGN(const BundleSummary theirs, SolveReferenceBundle(options, reference));
  EXPECT_NEAR(mine.initial_cost, theirs.initial_cost, 1e-12 * theirs.initial_cost);
  EXPECT_NEAR(mine.final_cost, theirs.final_cost, kRelativeCost * theirs.final_cost);
  EXPECT_TRUE(mine.converged) << mine.message;
  EXPECT_LE(mine.final_cost, mine.initial_cost);
}

// Bits: poses, offsets, rates, intrinsics, spacing.
class LineBundleFreedom : public ::testing::TestWithParam<int> {};

TEST_P(LineBundleFreedom, ReachesTheReferencesOptimum) {
  BundleSceneOptions scene_options = SmallScene();
  scene_options.free_poses = (GetParam() & 1) != 0;
  scene_options.free_offsets = (GetParam() & 2) != 0;
  scene_options.free_rates = (GetParam() & 4) != 0;
  scene_options.free_intrinsics = (GetParam() & 8) != 0;
  scene_options.free_spacing = (GetParam() & 16) != 0;
  const BundleScene scene = MakeBundleScene(scene_options);
  BundleProblem solved, reference;
  ExpectReferenceOptimum(Tight(), scene.start, &solved, &reference);
  ExpectSameEstimates(solved, reference);
}
INSTANTIATE_TEST_SUITE_P(EveryCombination, LineBundleFreedom, ::testing::Range(0, 32));

class LineBundleLoss : public ::testing::TestWithParam<BundleLoss> {};

TEST_P(LineBundleLoss, ReachesTheReferencesOptimum) {
  BundleSceneOptions scene_options = SmallScene();
  // Without a loss nobody converges among outliers.
  scene_options.outlier_share = GetParam() == BundleLoss::kNone ? 0 : 0.1;
  scene_options.free_spacing = true;
  const BundleScene scene = MakeBundleScene(scene_options);
  BundleOptions options = Tight();
  options.loss = GetParam();
  options.loss_scale = 1.7;
  BundleProblem solved, reference;
  ExpectReferenceOptimum(options, scene.start, &solved, &reference);
}
INSTANTIATE_TEST_SUITE_P(EveryLoss, LineBundleLoss,
                         ::testing::Values(BundleLoss::kNone, BundleLoss::kHuber,
                                           BundleLoss::kCauchy));

TEST(LineBundle, CountsWhatTheReferenceCounts) {
  BundleSceneOptions scene_options = SmallScene();
  scene_options.free_intrinsics = scene_options.free_spacing = true;
  BundleProblem solved = MakeBundleScene(scene_options).start, reference = solved;
  ASSERT_OK_AND_ASSIGN(const BundleSummary mine, SolveLineBundle({}, &solved));
  ASSERT_OK_AND_ASSIGN(const BundleSummary theirs, SolveReferenceBundle({}, &reference));
  EXPECT_EQ(mine.parameter_count, theirs.parameter_count);
  int priors = static_cast<int>(solved.target.marker_positions_m.size()) - 1;
  for (const BundleCamera& camera : solved.cameras) {
    priors += static_cast<int>((camera.intrinsics_sigma.array() > 0).count());
  }
  EXPECT_EQ(mine.residual_count, theirs.residual_count - priors);
}

TEST(LineBundle, SharesClocksBetweenCameras) {
  BundleSceneOptions scene_options = SmallScene();
  scene_options.clock_count = 2;
  scene_options.free_rates = scene_options.free_intrinsics = true;
  BundleProblem solved, reference;
  ExpectReferenceOptimum(Tight(), MakeBundleScene(scene_options).start, &solved, &reference);
  ExpectSameEstimates(solved, reference);
}

TEST(LineBundle, TakesACameraUnderTwoClocks) {
  BundleSceneOptions scene_options = SmallScene();
  scene_options.free_intrinsics = true;
  BundleProblem start = MakeBundleScene(scene_options).start;
  start.clocks.push_back(start.clocks[2]);
  const int late = static_cast<int>(start.clocks.size()) - 1;
  for (size_t i = 0; i < start.instants.size(); ++i) {
    for (int o = 0; o < start.instants[i].observation_count; ++o) {
      BundleObservation& observation =
          start.observations[static_cast<size_t>(start.instants[i].first_observation + o)];
      // Both within one group of eight and in groups of their own.
      if (observation.camera == 2 && (i % 3 == 0 || i > 16)) observation.clock = late;
    }
  }
  BundleProblem solved, reference;
  ExpectReferenceOptimum(Tight(), start, &solved, &reference);
  ExpectSameEstimates(solved, reference);
}

TEST(LineBundle, TakesACameraAndAMarkerTwiceInAnInstant) {
  BundleSceneOptions scene_options = SmallScene();
  scene_options.dropout_share = 0;
  BundleProblem start = MakeBundleScene(scene_options).start;
  BundleInstant& instant = start.instants[3];
  const BundleObservation twice =
      start.observations[static_cast<size_t>(instant.first_observation + 1)];
  // A copy of all observations with one of them doubled, and a marker doubled in another.
  const int first = static_cast<int>(start.observations.size());
  for (int o = 0; o < instant.observation_count; ++o) {
    start.observations.push_back(
        start.observations[static_cast<size_t>(instant.first_observation + o)]);
  }
  start.observations.push_back(twice);
  instant.first_observation = first;
  ++instant.observation_count;
  BundleObservation& doubled = start.observations[static_cast<size_t>(first + 2)];
  const int first_marker = static_cast<int>(start.markers.size());
  for (const int m : {0, 1, 1, 2}) {
    start.markers.push_back(start.markers[static_cast<size_t>(doubled.first_marker + m)]);
    start.markers.back().centre_px.x() += m;
  }
  doubled.first_marker = first_marker;
  doubled.marker_count = 4;
  BundleProblem solved, reference;
  ExpectReferenceOptimum(Tight(), start, &solved, &reference);
}

TEST(LineBundle, TakesSparseInstants) {
  BundleSceneOptions scene_options = SmallScene();
  scene_options.camera_count = 9;
  scene_options.instant_count = 100;
  scene_options.hidden_share = 0.6;
  scene_options.dropout_share = 0.3;
  BundleProblem start = MakeBundleScene(scene_options).start;
  // No marker at all, one marker by one camera, and left out as a whole.
  const auto keep_first_markers = [&start](size_t i, int markers) {
    BundleInstant& instant = start.instants[i];
    for (int o = 0; o < instant.observation_count; ++o) {
      const auto& observation =
          start.observations[static_cast<size_t>(instant.first_observation + o)];
      for (int m = 0; m < observation.marker_count; ++m) {
        BundleMarker& marker = start.markers[static_cast<size_t>(observation.first_marker + m)];
        marker.used = marker.used && markers-- > 0;
      }
    }
  };
  keep_first_markers(4, 0);
  keep_first_markers(5, 1);
  keep_first_markers(50, 2);
  start.instants[7].used = false;
  BundleProblem solved, reference;
  ExpectReferenceOptimum(Tight(), start, &solved, &reference);
  EXPECT_EQ(solved.instants[4].origin_m, start.instants[4].origin_m);
  EXPECT_EQ(solved.instants[7].origin_m, start.instants[7].origin_m);
  EXPECT_NE(solved.instants[8].origin_m, start.instants[8].origin_m);
  EXPECT_TRUE(solved.instants[5].origin_m.allFinite());
}

TEST(LineBundle, LeavesAloneWhatNoMarkerTouches) {
  BundleSceneOptions scene_options = SmallScene();
  scene_options.free_intrinsics = true;
  BundleProblem start = MakeBundleScene(scene_options).start;
  for (BundleObservation& observation : start.observations) {
    for (int m = 0; observation.camera == 3 && m < observation.marker_count; ++m) {
      start.markers[static_cast<size_t>(observation.first_marker + m)].used = false;
    }
  }
  BundleProblem solved, reference;
  ExpectReferenceOptimum(Tight(), start, &solved, &reference);
  EXPECT_EQ(solved.cameras[3].cam_from_rig.translation_m,
            start.cameras[3].cam_from_rig.translation_m);
  EXPECT_EQ(solved.cameras[3].intrinsics, start.cameras[3].intrinsics);
  EXPECT_EQ(solved.clocks[3].time_offset_s, start.clocks[3].time_offset_s);
}

TEST(LineBundle, SolvesInstantsOfASingleCamera) {
  BundleSceneOptions scene_options = SmallScene();
  scene_options.camera_count = 1;
  scene_options.dropout_share = 0;
  scene_options.start_error = 0.3;
  BundleProblem solved, reference;
  ExpectReferenceOptimum(Tight(), MakeBundleScene(scene_options).start, &solved, &reference);
}

TEST(LineBundle, FindsTheTruthWithoutNoise) {
  BundleSceneOptions scene_options = SmallScene();
  scene_options.noise_px = 0;
  const BundleScene scene = MakeBundleScene(scene_options);
  BundleProblem solved = scene.start;
  ASSERT_OK_AND_ASSIGN(const BundleSummary summary, SolveLineBundle(Tight(), &solved));
  EXPECT_LT(summary.final_cost, 1e-12);
  ExpectSameEstimates(solved, scene.truth);
}

TEST(LineBundle, TakesRootsThatSeeOneDirectionOnly) {
  BundleProblem start = MakeBundleScene(SmallScene()).start;
  start.markers[10].sqrt_information << 0, 2, 0, 1;
  start.markers[20].sqrt_information << 2, 0, 1, 0;
  start.markers[30].sqrt_information.setZero();
  start.markers[40].sqrt_information << -3, 1, 2, -4;
  BundleProblem solved, reference;
  ExpectReferenceOptimum(Tight(), start, &solved, &reference);
}

TEST(LineBundle, RepeatsItselfBitForBit) {
  BundleSceneOptions scene_options = SmallScene();
  scene_options.free_intrinsics = scene_options.free_rates = scene_options.free_spacing = true;
  const BundleScene scene = MakeBundleScene(scene_options);
  BundleProblem first = scene.start, second = scene.start;
  ASSERT_THAT(SolveLineBundle({}, &first), IsOk());
  ASSERT_THAT(SolveLineBundle({}, &second), IsOk());
  for (size_t c = 0; c < first.cameras.size(); ++c) {
    EXPECT_EQ(first.cameras[c].cam_from_rig.rotation.coeffs(),
              second.cameras[c].cam_from_rig.rotation.coeffs());
    EXPECT_EQ(first.cameras[c].intrinsics, second.cameras[c].intrinsics);
  }
  for (size_t i = 0; i < first.instants.size(); ++i) {
    EXPECT_EQ(first.instants[i].origin_m, second.instants[i].origin_m);
  }
}

// ---- a marker behind its camera ----

TEST(LineBundle, NamesAMarkerThatStartsBehindItsCamera) {
  BundleProblem problem = MakeBundleScene(SmallScene()).start;
  const RigidTransform& camera = problem.cameras[2].cam_from_rig;
  problem.instants[5].origin_m = camera.Inverse() * Eigen::Vector3d(0, 0, -1);
  const BundleProblem before = problem;
  EXPECT_THAT(SolveLineBundle({}, &problem),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       ::testing::AllOf(HasSubstr("instant 5"), HasSubstr("camera_2"))));
  EXPECT_EQ(problem.cameras[1].cam_from_rig.translation_m,
            before.cameras[1].cam_from_rig.translation_m);
}

TEST(LineBundle, IgnoresAMarkerBehindItsCameraThatIsNotUsed) {
  BundleProblem problem = MakeBundleScene(SmallScene()).start;
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
TEST(LineBundle, NeverStepsBehindACamera) {
  BundleSceneOptions scene_options = SmallScene();
  scene_options.dropout_share = 0;
  BundleProblem problem = MakeBundleScene(scene_options).truth;
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
      ASSERT_TRUE(ProjectWithJacobian(camera.model, camera.intrinsics.data(),
                                      camera.cam_from_rig * (behind + position * instant.direction),
                                      &marker.centre_px, nullptr, nullptr));
    }
  }
  instant.origin_m = rig_from_cam * Eigen::Vector3d(0, 0, 0.3);
  for (const BundleLoss loss : {BundleLoss::kNone, BundleLoss::kCauchy}) {
    BundleOptions options;
    options.loss = loss;
    BundleProblem solved = problem;
    ASSERT_OK_AND_ASSIGN(const BundleSummary summary, SolveLineBundle(options, &solved));
    EXPECT_LT(summary.final_cost, summary.initial_cost);
    EXPECT_GT((solved.cameras[1].cam_from_rig * solved.instants[5].origin_m).z(), 0);
    BundleProblem again = solved;  // a start out of sight would be refused
    EXPECT_THAT(SolveLineBundle(options, &again), IsOk());
  }
}

// ---- refusals and hooks ----

TEST(LineBundle, RefusesWhatIsNotFinite) {
  const BundleProblem good = MakeBundleScene(SmallScene()).start;
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

TEST(LineBundle, RefusesWhatItCannotSolve) {
  const BundleProblem good = MakeBundleScene(SmallScene()).start;
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

TEST(LineBundle, StopsWhenCancelledAndLeavesTheProblemAlone) {
  const BundleProblem start = MakeBundleScene(SmallScene()).start;
  std::atomic<bool> cancelled = false;
  BundleOptions options = Tight();
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

TEST(LineBundle, ReportsCostsThatNeverRise) {
  BundleProblem problem = MakeBundleScene(SmallScene()).start;
  BundleOptions options = Tight();
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

TEST(LineBundle, SaysWhenIterationsAreUsedUp) {
  BundleProblem problem = MakeBundleScene(SmallScene()).start;
  BundleOptions options = Tight();
  options.max_iterations = 1;
  ASSERT_OK_AND_ASSIGN(const BundleSummary summary, SolveLineBundle(options, &problem));
  EXPECT_FALSE(summary.converged);
  EXPECT_EQ(summary.iterations, 1);
  EXPECT_LT(summary.final_cost, summary.initial_cost);
}

// ---- information ----

TEST(ReducedInformation, InvertsToTheCovarianceOfCeres) {
  for (const BundleLoss loss : {BundleLoss::kNone, BundleLoss::kCauchy}) {
    BundleSceneOptions scene_options = SmallScene();
    scene_options.free_rates = scene_options.free_intrinsics = scene_options.free_spacing = true;
    BundleProblem problem = MakeBundleScene(scene_options).start;
    BundleOptions options = Tight();
    options.loss = loss;
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
  BundleSceneOptions scene_options = SmallScene();
  scene_options.camera_count = 2;
  scene_options.free_rates = scene_options.free_spacing = true;
  const BundleProblem problem = MakeBundleScene(scene_options).start;
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
}  // namespace rigcal::server
