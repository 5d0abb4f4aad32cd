// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/target_scale.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/solve/bundle/bundle_adjuster.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "tests/server/solve/exact_problem.h"
#include "tests/testing/bundle_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::target_scale_test {
namespace {

using ::rigcal::testing::IsOk;

// Three cameras, the second fixed and not at the origin; the wand's spans are given shorter than
// they are, by different shares.
BundleProblem Problem() {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0.2, 0}, {2, 0, 0.5}},
                                       {{{0.1, 0, 4}}, {{0.5, -0.3, 5}}, {{1.1, 0.2, 4.5}}});
  for (BundleCamera& camera : problem.cameras) camera.pose_fixed = false;
  problem.cameras[1].pose_fixed = true;
  problem.target.fixed = false;
  problem.target.given_positions_m = problem.target.marker_positions_m;
  problem.target.given_positions_m[1] *= 0.99;
  problem.target.given_positions_m[2] *= 0.98;
  return problem;
}

double SpansCost(const BundleTarget& target) {
  double cost = 0;
  for (size_t m = 1; m < target.marker_positions_m.size(); ++m) {
    const double error_m = target.marker_positions_m[m] - target.marker_positions_m[m - 1] -
                           (target.given_positions_m[m] - target.given_positions_m[m - 1]);
    cost += 0.5 * error_m * error_m / (target.span_sigma_m * target.span_sigma_m);
  }
  return cost;
}

TEST(SettleScale, LowersTheSpansCostAsFarAsItGoesAndLeavesEveryImage) {
  const BundleProblem before = Problem();
  BundleProblem after = before;
  const double gain = SettleScale(&after).gain;
  EXPECT_GT(gain, 0);
  EXPECT_NEAR(SpansCost(before.target) - SpansCost(after.target), gain, 1e-12);
  for (const double factor : {0.9999, 1.0001}) {
    BundleTarget other = after.target;
    for (double& position_m : other.marker_positions_m) position_m *= factor;
    EXPECT_GT(SpansCost(other), SpansCost(after.target));
  }
  EXPECT_EQ(after.cameras[1].cam_from_rig.translation_m,
            before.cameras[1].cam_from_rig.translation_m);
  EXPECT_GT(
      (after.cameras[0].cam_from_rig.translation_m - before.cameras[0].cam_from_rig.translation_m)
          .norm(),
      1e-3);
  for (const BundleInstant& instant : after.instants) {
    for (const BundleObservation& observation : after.ObservationsOf(instant)) {
      for (const BundleMarker& marker : after.MarkersOf(observation)) {
        const auto residual_px = MarkerResidualPx(after, instant, observation, marker);
        ASSERT_TRUE(residual_px);
        EXPECT_LT(residual_px->norm(), 1e-9);
      }
    }
  }
  EXPECT_NEAR(SettleScale(&after).factor, 1, 1e-12);  // nothing is left
}

TEST(SettleScale, LeavesAScaleThatIsNotFree) {
  const auto expect_left = [](const char* what, void (*change)(BundleProblem*)) {
    BundleProblem problem = Problem();
    change(&problem);
    const std::vector<double> positions_m = problem.target.marker_positions_m;
    EXPECT_EQ(SettleScale(&problem).factor, 1) << what;
    EXPECT_EQ(problem.target.marker_positions_m, positions_m) << what;
  };
  expect_left("fixed target", [](BundleProblem* problem) { problem->target.fixed = true; });
  expect_left("two fixed places",
              [](BundleProblem* problem) { problem->cameras[0].pose_fixed = true; });
  expect_left("nothing that has a length", [](BundleProblem* problem) {
    for (BundleMarker& marker : problem->markers) marker.used = marker.marker == 0;
  });
}

// The tolerance of the cost is far above what the spans' priors cost beside the images here.
TEST(SettleScale, AnAdjustmentEndsAtTheScaleThatTheSpansGive) {
  BundleProblem problem = Problem();
  problem.target.span_sigma_m = 0.2;
  for (BundleMarker& marker : problem.markers) marker.centre_px.x() += marker.marker == 1 ? 1 : -1;
  BundleOptions options;
  options.function_tolerance = 1e-3;
  ASSERT_THAT(SolveLineBundle(options, &problem), IsOk());
  EXPECT_NEAR(SettleScale(&problem).factor, 1, 1e-15);
}

// How much larger the target is seen than its priors have it; 1: they agree.
double SpansFactor(const BundleTarget& target) {
  double product = 0, square = 0;
  for (const BundleWand& wand : target.Wands()) {
    for (int m = wand.first + 1; m < wand.end; ++m) {
      const auto i = static_cast<size_t>(m);
      const double span_m = target.marker_positions_m[i] - target.marker_positions_m[i - 1];
      const double given_m = target.given_positions_m[i] - target.given_positions_m[i - 1];
      product += span_m * given_m / (wand.span_sigma_m * wand.span_sigma_m);
      square += span_m * span_m / (wand.span_sigma_m * wand.span_sigma_m);
    }
  }
  return product / square;
}

// The whole problem larger about the camera that is fixed: no image changes.
void Enlarge(double factor, BundleProblem* problem) {
  for (double& position_m : problem->target.marker_positions_m) position_m *= factor;
  for (Eigen::Vector3d& point_m : problem->rigid_target.points_m) point_m *= factor;
  const Eigen::Vector3d centre_m = *FixedCentre(*problem);
  for (BundleCamera& camera : problem->cameras) {
    if (camera.pose_fixed) continue;
    camera.cam_from_rig.translation_m = factor * camera.cam_from_rig.translation_m -
                                        (1 - factor) * (camera.cam_from_rig.rotation * centre_m);
  }
  for (BundleInstant& instant : problem->instants) {
    instant.origin_m = centre_m + factor * (instant.origin_m - centre_m);
  }
}

std::vector<double> Positions(int markers) {
  std::vector<double> positions_m;
  for (int m = 0; m < markers; ++m) positions_m.push_back(0.04 * m + (m % 3 == 1 ? 0.01 : 0));
  return positions_m;
}

void SetFocal(double focal_px, BundleProblem* problem) {
  for (BundleCamera& camera : problem->cameras) {
    camera.intrinsics[0] *= focal_px / 1000;
    camera.intrinsics[1] *= focal_px / 1000;
    camera.intrinsics_mean = camera.intrinsics;
  }
}

// Both paths, from 3 % off; the tolerances are those with which a calibration ends.
TEST(SettleScale, BothPathsEndAtTheScaleOfThePriorsWhateverTheTarget) {
  for (const bool is_general : {false, true}) {
    for (const int markers : {2, 3, 6, 16}) {
      for (const double sigma_rel : {0.001, 0.01, 0.1}) {
        for (const double focal_px : {400.0, 1000.0, 3000.0}) {
          SCOPED_TRACE(absl::StrCat(is_general ? "Ceres, " : "line kernel, ", markers, " markers, ",
                                    sigma_rel, ", ", focal_px, " px"));
          ::rigcal::testing::BundleSceneOptions options;
          options.marker_positions_m = Positions(markers);
          options.free_spacing = true;
          options.noise_px = 0.3 * focal_px / 1000;  // in rays the same
          BundleProblem problem = ::rigcal::testing::MakeBundleScene(options).initial;
          problem.target.given_positions_m = problem.target.marker_positions_m = Positions(markers);
          problem.target.span_sigma_m = sigma_rel * 0.04;
          for (BundleMarker& marker : problem.markers) {
            const Eigen::Vector2d middle(640, 512);
            marker.centre_px =
                middle + focal_px / 1000 * (Eigen::Vector2d(marker.centre_px) - middle);
            marker.velocity_px_s = focal_px / 1000 * Eigen::Vector2d(marker.velocity_px_s);
            marker.sqrt_information = 1000 / focal_px * Eigen::Matrix2d(marker.sqrt_information);
          }
          for (BundleCamera& camera : problem.cameras) {
            const Eigen::Vector2d middle(640, 512);
            camera.intrinsics.segment<2>(2) =
                middle + focal_px / 1000 * (camera.intrinsics.segment<2>(2) - middle);
            camera.middle_row = 512;
          }
          SetFocal(focal_px, &problem);
          Enlarge(0.97, &problem);
          BundleOptions bundle;
          bundle.function_tolerance = 1e-5;
          ASSERT_OK_AND_ASSIGN(
              const BundleSummary summary,
              is_general ? SolveBundle(bundle, &problem) : SolveLineBundle(bundle, &problem));
          EXPECT_NEAR(SpansFactor(problem.target), 1, 1e-12);
          EXPECT_LT(summary.final_cost, summary.initial_cost);
        }
      }
    }
  }
}

// Two wands of other tolerances, a rigid part and a point beside each other: one factor for all.
TEST(SettleScale, EveryTargetHasItsSayByItsSigma) {
  ::rigcal::testing::BundleSceneOptions options;
  options.marker_positions_m = {0, 0.2, 0, 0.3, 0.5};
  options.points_m = {{0, 0, 0}, {0.2, 0, 0.01}, {0, 0.15, 0}, {0.1, 0.1, 0.1}, {0.3, 0.3, 0.3}};
  options.rigid_every = 2;
  options.noise_px = 0;
  BundleProblem problem = ::rigcal::testing::MakeBundleScene(options).ground_truth;
  problem.target.fixed = problem.rigid_target.fixed = false;
  problem.target.wands = {{0, 2, 0.001}, {2, 5, 0.004}};
  problem.rigid_target.first_points = {0, 4};
  problem.rigid_target.sigma_m.assign(5, 0.002);
  // Each instant shows one of them.
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    for (const BundleObservation& observation : problem.ObservationsOf(problem.instants[i])) {
      for (BundleMarker& marker : problem.MarkersOf(observation)) {
        const bool is_rigid = problem.instants[i].is_rigid;
        const bool is_second = i % 4 >= 2;
        marker.used = is_second == (marker.marker >= (is_rigid ? 4 : 2));
      }
    }
  }
  const BundleProblem truth = problem;
  // The given points lie elsewhere, and are a little smaller.
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.05, Eigen::Vector3d(1, 2, 3).normalized()));
  for (Eigen::Vector3d& point_m : problem.rigid_target.given_points_m) {
    point_m = 0.99 * (turn * point_m) + Eigen::Vector3d(0.01, 0.02, -0.01);
  }
  problem.target.given_positions_m = {0, 0.2 * 1.01, 0, 0.3, 0.5};
  const SettledScale settled = SettleScale(&problem);
  // By hand: of the rigid part the size about its middle.
  double product = 0.2 * 0.202 / 1e-6 + (0.3 * 0.3 + 0.2 * 0.2) / 16e-6;
  double square = 0.2 * 0.2 / 1e-6 + (0.3 * 0.3 + 0.2 * 0.2) / 16e-6;
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  for (int i = 0; i < 4; ++i) middle_m += truth.rigid_target.points_m[static_cast<size_t>(i)] / 4;
  for (int i = 0; i < 4; ++i) {
    const double size =
        (truth.rigid_target.points_m[static_cast<size_t>(i)] - middle_m).squaredNorm() / 4e-6;
    product += 0.99 * size;
    square += size;
  }
  EXPECT_NEAR(settled.factor, product / square, 1e-12);
  EXPECT_GT(settled.gain, 0);
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    for (const BundleObservation& observation : problem.ObservationsOf(problem.instants[i])) {
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        if (!marker.used) continue;
        const auto residual_px =
            MarkerResidualPx(problem, problem.instants[i], observation, marker);
        const auto before_px = MarkerResidualPx(truth, truth.instants[i], observation, marker);
        ASSERT_TRUE(residual_px && before_px);
        EXPECT_LT((*residual_px - *before_px).norm(), 1e-8);
      }
    }
  }
  EXPECT_NEAR(SettleScale(&problem).factor, 1, 1e-12);
  // Two points that are held say how large everything is.
  problem.rigid_target.sigma_m[0] = problem.rigid_target.sigma_m[1] = 0;
  EXPECT_EQ(SettleScale(&problem).factor, 1);
}

TEST(SettleScale, ADistanceIsALengthLikeOthers) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {{{0.1, 0, 4}}, {{0.5, -0.3, 5}}});
  problem.target.marker_positions_m = problem.target.given_positions_m = {0};
  std::erase_if(problem.markers, [](const BundleMarker& marker) { return marker.marker > 0; });
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    problem.observations[i].first_marker = static_cast<int>(i);
    problem.observations[i].marker_count = 1;
  }
  problem.distance = BundleDistance{0, 1, 1.25, 1e-4};
  EXPECT_NEAR(SettleScale(&problem).factor, 1.25, 1e-12);
  EXPECT_NEAR(problem.cameras[1].cam_from_rig.translation_m.norm(), 1.25, 1e-12);
}

// Marker 1 is never seen: what is known of the two spans beside it is known of their sum.
TEST(SettleScale, AMarkerThatNobodySeesHasNoSay) {
  BundleProblem problem = Problem();
  for (BundleMarker& marker : problem.markers) marker.used = marker.marker != 1;
  problem.target.marker_positions_m[1] = 0.2;  // where an adjustment may have left it
  const double given_m = problem.target.given_positions_m[2];
  SettleScale(&problem);
  EXPECT_NEAR(problem.target.marker_positions_m[2], given_m, 1e-12);
  EXPECT_NEAR(problem.target.marker_positions_m[1], problem.target.given_positions_m[1], 1e-12);
}

}  // namespace
}  // namespace rigcal::server::target_scale_test
