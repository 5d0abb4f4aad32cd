// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "server/solve/bundle/bundle_adjuster.h"
#include "server/solve/bundle/bundle_information.h"
#include "tests/bench/reference_bundle.h"
#include "tests/testing/bundle_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::line_bundle_test {
namespace {

using ::rigcal::testing::BundleScene;
using ::rigcal::testing::BundleSceneOptions;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::MakeBundleScene;
using ::rigcal::testing::SmallBundleScene;
using ::rigcal::testing::SolveReferenceBundle;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TightTolerances;
using ::testing::HasSubstr;

constexpr double kRelativeCost = 1e-9;  // what "the same optimum" means, by the issue

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

// Both paths know rolling shutters; the noise-free scene says that they are right, too.
TEST(LineBundleLineDelays, AreThoseOfTheGeneralPathAndTheTrueOnes) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.free_line_delays = true;
  scene_options.noise_px = 0;
  scene_options.outlier_share = 0;
  const BundleScene scene = MakeBundleScene(scene_options);
  BundleProblem by_kernel = scene.initial, by_ceres = scene.initial;
  ASSERT_THAT(SolveLineBundle(TightTolerances(), &by_kernel), IsOk());
  ASSERT_THAT(SolveBundle(TightTolerances(), &by_ceres), IsOk());
  for (size_t c = 0; c < by_kernel.cameras.size(); ++c) {
    EXPECT_NEAR(by_kernel.cameras[c].line_delay_s, by_ceres.cameras[c].line_delay_s, 1e-9);
    EXPECT_NEAR(by_kernel.cameras[c].line_delay_s, scene.ground_truth.cameras[c].line_delay_s,
                1e-7);
  }
}

TEST(LineBundleLineDelays, HaveTheInformationOfTheGeneralPath) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.free_line_delays = true;
  const BundleProblem problem = MakeBundleScene(scene_options).ground_truth;
  ASSERT_OK_AND_ASSIGN(const ReducedInformation kernel,
                       ComputeReducedInformation(BundleOptions(), problem));
  ASSERT_OK_AND_ASSIGN(const ReducedInformation general,
                       ComputeGeneralInformation(BundleOptions(), problem));
  ASSERT_EQ(kernel.parameters, general.parameters);
  const Eigen::VectorXd scale = general.information.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT((scale.asDiagonal() * (kernel.information - general.information) * scale.asDiagonal())
                .cwiseAbs()
                .maxCoeff(),
            1e-9);
}

// Of the cost with its robust loss, the instants eliminated.
TEST(LineBundle, HasTheGradientOfTheGeneralPath) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.free_offsets = scene_options.free_rates = scene_options.free_intrinsics =
      scene_options.free_spacing = false;
  const BundleProblem problem = MakeBundleScene(scene_options).ground_truth;
  ASSERT_OK_AND_ASSIGN(const ReducedInformation kernel,
                       ComputeReducedInformation(BundleOptions(), problem));
  ASSERT_OK_AND_ASSIGN(const ReducedInformation general,
                       ComputeGeneralInformation(BundleOptions(), problem));
  ASSERT_EQ(kernel.parameters, general.parameters);
  const Eigen::VectorXd scale = general.information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::VectorXd gradient = scale.cwiseProduct(general.gradient);
  EXPECT_GT(gradient.norm(), 0.1);
  EXPECT_LT((scale.cwiseProduct(kernel.gradient) - gradient).norm(), 1e-6 * gradient.norm());
}

// Solves with both; costs at the start and at the end must agree.
void ExpectReferenceOptimum(const BundleOptions& options, const BundleProblem& start,
                            BundleProblem* solved, BundleProblem* reference) {
  *solved = *reference = start;
  ASSERT_OK_AND_ASSIGN(const BundleSummary mine, SolveLineBundle(options, solved));
  ASSERT_OK_AND_ASSIGN(const BundleSummary theirs, SolveReferenceBundle(options, reference));
  EXPECT_NEAR(mine.initial_cost, theirs.initial_cost, 1e-12 * theirs.initial_cost);
  EXPECT_NEAR(mine.final_cost, theirs.final_cost, kRelativeCost * theirs.final_cost);
  EXPECT_TRUE(mine.converged);
  EXPECT_LE(mine.final_cost, mine.initial_cost);
}

// Bits: poses, offsets, rates, intrinsics, spacing.
class LineBundleFreedom : public ::testing::TestWithParam<int> {};

TEST_P(LineBundleFreedom, ReachesTheReferencesOptimum) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.free_poses = (GetParam() & 1) != 0;
  scene_options.free_offsets = (GetParam() & 2) != 0;
  scene_options.free_rates = (GetParam() & 4) != 0;
  scene_options.free_intrinsics = (GetParam() & 8) != 0;
  scene_options.free_spacing = (GetParam() & 16) != 0;
  const BundleScene scene = MakeBundleScene(scene_options);
  BundleProblem solved, reference;
  ExpectReferenceOptimum(TightTolerances(), scene.initial, &solved, &reference);
  ExpectSameEstimates(solved, reference);
}
INSTANTIATE_TEST_SUITE_P(EveryCombination, LineBundleFreedom, ::testing::Range(0, 32));

class LineBundleLoss : public ::testing::TestWithParam<bool> {};

TEST_P(LineBundleLoss, ReachesTheReferencesOptimum) {
  BundleSceneOptions scene_options = SmallBundleScene();
  // Without a loss nobody converges among outliers.
  scene_options.outlier_share = GetParam() ? 0.1 : 0;
  scene_options.free_spacing = true;
  const BundleScene scene = MakeBundleScene(scene_options);
  BundleOptions options = TightTolerances();
  options.robust = GetParam();
  options.loss_scale = 1.7;
  BundleProblem solved, reference;
  ExpectReferenceOptimum(options, scene.initial, &solved, &reference);
}
INSTANTIATE_TEST_SUITE_P(EveryLoss, LineBundleLoss, ::testing::Bool());

// More columns than a full batch leaves room for in the cache, and a last batch that is not full.
TEST(LineBundle, ReachesTheReferencesOptimumWithManyCameras) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.camera_count = 30;
  scene_options.instant_count = 77;
  scene_options.hidden_share = 0.3;
  scene_options.free_rates = scene_options.free_intrinsics = scene_options.free_spacing = true;
  BundleOptions options = TightTolerances();
  options.function_tolerance = 1e-12;
  BundleProblem solved, reference;
  ExpectReferenceOptimum(options, MakeBundleScene(scene_options).initial, &solved, &reference);
}

// The first marker of each observation alone, and a distance that holds the scale.
BundleProblem OnePointOf(const BundleProblem& wand, double distance_m) {
  BundleProblem point = wand;
  point.target.marker_positions_m = point.target.given_positions_m = {0};
  point.target.fixed = true;
  point.markers.clear();
  for (BundleObservation& observation : point.observations) {
    const int first = observation.first_marker;
    observation.first_marker = static_cast<int>(point.markers.size());
    int count = 0;
    for (int m = first; m < first + observation.marker_count; ++m) {
      if (wand.markers[static_cast<size_t>(m)].marker != 0) continue;
      point.markers.push_back(wand.markers[static_cast<size_t>(m)]);
      ++count;
    }
    observation.marker_count = count;
  }
  point.distance = BundleDistance{1, 2, distance_m, 1e-4 * distance_m};
  return point;
}

double DistanceOf(const BundleProblem& problem) {
  return (problem.cameras[1].cam_from_rig.SourceFromTargetTranslation() -
          problem.cameras[2].cam_from_rig.SourceFromTargetTranslation())
      .norm();
}

TEST(LineBundle, ReachesTheOptimumOfCeresWithOneMarkerAndADistance) {
  for (const bool free_intrinsics : {false, true}) {
    BundleSceneOptions scene_options = SmallBundleScene();
    scene_options.free_spacing = false;
    scene_options.free_intrinsics = free_intrinsics;
    const BundleScene scene = MakeBundleScene(scene_options);
    const BundleProblem start = OnePointOf(scene.initial, 1.2 * DistanceOf(scene.initial));
    BundleProblem solved = start, ceres = start;
    ASSERT_OK_AND_ASSIGN(const BundleSummary mine, SolveLineBundle(TightTolerances(), &solved));
    ASSERT_OK_AND_ASSIGN(const BundleSummary theirs, SolveBundle(TightTolerances(), &ceres));
    EXPECT_NEAR(mine.initial_cost, theirs.initial_cost, 1e-12 * theirs.initial_cost);
    EXPECT_NEAR(mine.final_cost, theirs.final_cost, kRelativeCost * theirs.final_cost);
    ExpectSameEstimates(solved, ceres);
    // Nothing contradicts the distance, so both have it whatever the sigma.
    EXPECT_NEAR(DistanceOf(solved), start.distance->distance_m, 1e-9);
    EXPECT_NEAR(DistanceOf(ceres), start.distance->distance_m, 1e-9);
  }
}

TEST(LineBundle, RefusesADistanceThatIsNone) {
  const BundleProblem wand = MakeBundleScene(SmallBundleScene()).initial;
  for (const BundleDistance& wrong :
       {BundleDistance{1, 1, 1, 1}, BundleDistance{-1, 1, 1, 1}, BundleDistance{0, 99, 1, 1},
        BundleDistance{0, 1, 0, 1}, BundleDistance{0, 1, std::nan(""), 1},
        BundleDistance{0, 1, 1, 0}}) {
    BundleProblem problem = OnePointOf(wand, 1);
    problem.distance = wrong;
    EXPECT_THAT(SolveLineBundle({}, &problem),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("distance")));
  }
}

TEST(LineBundle, SharesClocksBetweenCameras) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.clock_count = 2;
  scene_options.free_rates = scene_options.free_intrinsics = true;
  BundleProblem solved, reference;
  ExpectReferenceOptimum(TightTolerances(), MakeBundleScene(scene_options).initial, &solved,
                         &reference);
  ExpectSameEstimates(solved, reference);
}

TEST(LineBundle, TakesACameraUnderTwoClocks) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.free_intrinsics = true;
  BundleProblem start = MakeBundleScene(scene_options).initial;
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
  ExpectReferenceOptimum(TightTolerances(), start, &solved, &reference);
  ExpectSameEstimates(solved, reference);
}

TEST(LineBundle, TakesACameraAndAMarkerTwiceInAnInstant) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.dropout_share = 0;
  BundleProblem start = MakeBundleScene(scene_options).initial;
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
  ExpectReferenceOptimum(TightTolerances(), start, &solved, &reference);
}

TEST(LineBundle, TakesSparseInstants) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.camera_count = 9;
  scene_options.instant_count = 100;
  scene_options.hidden_share = 0.6;
  scene_options.dropout_share = 0.3;
  BundleProblem start = MakeBundleScene(scene_options).initial;
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
  ExpectReferenceOptimum(TightTolerances(), start, &solved, &reference);
  EXPECT_EQ(solved.instants[4].origin_m, start.instants[4].origin_m);
  EXPECT_EQ(solved.instants[7].origin_m, start.instants[7].origin_m);
  EXPECT_NE(solved.instants[8].origin_m, start.instants[8].origin_m);
  EXPECT_TRUE(solved.instants[5].origin_m.allFinite());
}

TEST(LineBundle, LeavesAloneWhatNoMarkerTouches) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.free_intrinsics = true;
  BundleProblem start = MakeBundleScene(scene_options).initial;
  for (BundleObservation& observation : start.observations) {
    for (int m = 0; observation.camera == 3 && m < observation.marker_count; ++m) {
      start.markers[static_cast<size_t>(observation.first_marker + m)].used = false;
    }
  }
  BundleProblem solved, reference;
  ExpectReferenceOptimum(TightTolerances(), start, &solved, &reference);
  EXPECT_EQ(solved.cameras[3].cam_from_rig.translation_m,
            start.cameras[3].cam_from_rig.translation_m);
  EXPECT_EQ(solved.cameras[3].intrinsics, start.cameras[3].intrinsics);
  EXPECT_EQ(solved.clocks[3].time_offset_s, start.clocks[3].time_offset_s);
}

TEST(LineBundle, SolvesInstantsOfASingleCamera) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.camera_count = 1;
  scene_options.dropout_share = 0;
  scene_options.initial_error = 0.3;
  BundleProblem solved, reference;
  ExpectReferenceOptimum(TightTolerances(), MakeBundleScene(scene_options).initial, &solved,
                         &reference);
}

TEST(LineBundle, FindsTheGroundTruthWithoutNoise) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.noise_px = 0;
  const BundleScene scene = MakeBundleScene(scene_options);
  BundleProblem solved = scene.initial;
  ASSERT_OK_AND_ASSIGN(const BundleSummary summary, SolveLineBundle(TightTolerances(), &solved));
  EXPECT_LT(summary.final_cost, 1e-12);
  ExpectSameEstimates(solved, scene.ground_truth);
}

TEST(LineBundle, TakesRootsThatSeeOneDirectionOnly) {
  BundleProblem start = MakeBundleScene(SmallBundleScene()).initial;
  start.markers[10].sqrt_information << 0, 2, 0, 1;
  start.markers[20].sqrt_information << 2, 0, 1, 0;
  start.markers[30].sqrt_information.setZero();
  start.markers[40].sqrt_information << -3, 1, 2, -4;
  BundleProblem solved, reference;
  ExpectReferenceOptimum(TightTolerances(), start, &solved, &reference);
}

TEST(LineBundle, RepeatsItselfBitForBit) {
  BundleSceneOptions scene_options = SmallBundleScene();
  scene_options.free_intrinsics = scene_options.free_rates = scene_options.free_spacing = true;
  const BundleScene scene = MakeBundleScene(scene_options);
  BundleProblem first = scene.initial, second = scene.initial;
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

}  // namespace
}  // namespace rigcal::server::line_bundle_test
