// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/target_scale.h"

#include <gtest/gtest.h>

#include "server/solve/bundle/line_bundle.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "tests/server/solve/exact_problem.h"
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
  const double gain = SettleScale(&after);
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
  EXPECT_NEAR(SettleScale(&after), 0, 1e-12);  // nothing is left
}

TEST(SettleScale, LeavesAScaleThatIsNotFree) {
  const auto expect_left = [](const char* what, void (*change)(BundleProblem*)) {
    BundleProblem problem = Problem();
    change(&problem);
    const std::vector<double> positions_m = problem.target.marker_positions_m;
    EXPECT_EQ(SettleScale(&problem), 0) << what;
    EXPECT_EQ(problem.target.marker_positions_m, positions_m) << what;
  };
  expect_left("fixed target", [](BundleProblem* problem) { problem->target.fixed = true; });
  expect_left("known distance", [](BundleProblem* problem) {
    problem->distance = BundleDistance{0, 1, 1.0, 1e-4};
  });
  expect_left("two fixed places",
              [](BundleProblem* problem) { problem->cameras[0].pose_fixed = true; });
  expect_left("one marker", [](BundleProblem* problem) {
    problem->target.marker_positions_m = {0};
    problem->target.given_positions_m = {0};
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
  EXPECT_NEAR(SettleScale(&problem), 0, 1e-15);
}

}  // namespace
}  // namespace rigcal::server::target_scale_test
