// SPDX-License-Identifier: Apache-2.0
// The scale of a whole solve: what the priors of the target say, and known as well as they say it.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::settled_scale_test {
namespace {

using ::rigcal::testing::IsOk;

Target EvenWand(int markers, double tolerance_m) {
  Target target;
  for (int m = 0; m < markers; ++m) target.marker_positions_m.push_back(0.04 * m);
  target.span_tolerance_m = tolerance_m;
  return target;
}

CalibrationOptions With(TrajectoryChoice trajectory) {
  CalibrationOptions options;
  options.trajectory = trajectory;
  options.intrinsics = Estimate::kFixed;
  return options;
}

// Free-running, so that a path through time is of use.
constexpr char kRig[] = "cameras=3;duration=8;rate=12;free_running=true";

// How much larger the spans are than their priors have them, and 1 / sigma^2 of that.
struct SpansScale {
  double factor = 1, information = 0;
};
SpansScale ScaleOf(const CalibratedTarget& target) {
  double product = 0, square = 0;
  for (size_t m = 1; m < target.marker_positions_m.size(); ++m) {
    const double span_m = target.marker_positions_m[m] - target.marker_positions_m[m - 1];
    product +=
        span_m * (target.given.marker_positions_m[m] - target.given.marker_positions_m[m - 1]);
    square += span_m * span_m;
  }
  return {product / square, square / std::pow(target.given.span_tolerance_m, 2)};
}

CalibrationResult Solve(const SimulatedWorld& world, const CalibrationOptions& options) {
  const CalibrationOutcome outcome = Calibrate(InputOf(world), options);
  EXPECT_THAT(outcome.result, IsOk());
  return outcome.result.ok() ? *outcome.result : CalibrationResult();
}

TEST(SettledScale, IsWhatThePriorsSayOnEveryPathForAnyNumberOfMarkers) {
  for (const TrajectoryChoice path : {TrajectoryChoice::kInterpolated, TrajectoryChoice::kSpline}) {
    for (const int markers : {2, 3, 6, 16}) {
      for (const double tolerance_m : {0.00004, 0.002, 0.004}) {
        SCOPED_TRACE(absl::StrCat(path == TrajectoryChoice::kSpline ? "spline" : "interpolated",
                                  ", ", markers, " markers, ", tolerance_m));
        const CalibrationResult result = Solve(
            WorldOf(absl::StrCat(kRig, ";seed=4"), EvenWand(markers, tolerance_m)), With(path));
        ASSERT_FALSE(result.target.marker_positions_m.empty());
        EXPECT_EQ(result.trajectory.kind == CalibratedTrajectory::Kind::kSpline,
                  path == TrajectoryChoice::kSpline);
        const SpansScale scale = ScaleOf(result.target);
        EXPECT_NEAR(scale.factor, 1, 1e-9);
        // What the images leave open of the shape is a small part.
        EXPECT_NEAR(result.target.scale_sigma_rel * std::sqrt(scale.information), 1, 0.1);
      }
    }
  }
}

// Over rigs whose true spans are drawn from their tolerance: the scale is off by what is stated.
TEST(SettledScale, IsOffByWhatIsStated) {
  constexpr int kRigs = 12;
  for (const TrajectoryChoice path : {TrajectoryChoice::kInterpolated, TrajectoryChoice::kSpline}) {
    for (const int markers : {2, 6}) {
      double sum = 0;
      for (int seed = 1; seed <= kRigs; ++seed) {
        const SimulatedWorld world = WorldOf(absl::StrCat(kRig, ";length_sigma=0.002;seed=", seed),
                                             EvenWand(markers, 0.002));
        const CalibrationResult result = Solve(world, With(path));
        ASSERT_EQ(result.cameras.size(), 3u);
        const auto centre = [&world](size_t c) {
          return world.cameras()[c].cam_from_rig.SourceFromTargetTranslation();
        };
        const double true_m = (centre(1) - centre(0)).norm() + (centre(2) - centre(0)).norm();
        const double found_m = result.cameras[1].cam_from_rig.translation_m.norm() +
                               result.cameras[2].cam_from_rig.translation_m.norm();
        sum += std::pow((found_m / true_m - 1) / result.target.scale_sigma_rel, 2);
      }
      // 0.1 % of a chi square of 12 degrees of freedom lies below the one, and above the other, by
      // degree.
      EXPECT_GT(sum / kRigs, 0.18) << markers << " markers";
      EXPECT_LT(sum / kRigs, 2.74) << markers << " markers";
      RecordProperty(absl::StrCat(path == TrajectoryChoice::kSpline ? "spline_" : "interpolated_",
                                  markers, "_markers_nees"),
                     absl::StrCat(sum / kRigs));
    }
  }
}

// Where held poses have the scale the wand is as long as they see it, whatever is given.
TEST(SettledScale, OfARepairIsThatOfTheHeldCameras) {
  const SimulatedWorld world = WorldOf("cameras=4;duration=16;rate=20;seed=2", EvenWand(6, 0.002));
  const CalibrationResult parent = Solve(world, {});
  ASSERT_EQ(parent.cameras.size(), 4u);
  CalibrationInput input = InputOf(world);
  for (double& position_m : input.target.marker_positions_m) position_m *= 1.02;
  input.parent = parent;
  CalibrationOptions repair;
  repair.kind = SolveKind::kRepair;
  repair.parent_id = "c-000001";
  repair.only_cameras = {"sim_2"};
  const CalibrationOutcome outcome = Calibrate(std::move(input), repair);
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_NEAR(ScaleOf(outcome.result->target).factor, 1.02, 0.001);
  for (const size_t c : {0, 1, 3}) {
    EXPECT_EQ(outcome.result->cameras[c].cam_from_rig.translation_m,
              parent.cameras[c].cam_from_rig.translation_m);
    EXPECT_EQ(outcome.result->cameras[c].cam_from_rig.rotation.coeffs(),
              parent.cameras[c].cam_from_rig.rotation.coeffs());
  }
  EXPECT_NEAR(outcome.result->cameras[2].cam_from_rig.translation_m.norm(),
              parent.cameras[2].cam_from_rig.translation_m.norm(), 0.01);
}

// A body of labelled points, alone and beside a wand: on the general path.
TEST(SettledScale, IsThatOfThePointsOfABody) {
  const Target body = BodyTarget(0.001);
  const CalibrationResult result = Solve(WorldOf("cameras=3;duration=8;rate=12;seed=3", body),
                                         With(TrajectoryChoice::kInterpolated));
  ASSERT_EQ(result.target.given.points.size(), body.points.size());
  double information = 0;
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  for (const TargetPoint& point : body.points) {
    middle_m +=
        Eigen::Vector3d(point.x_m, point.y_m, point.z_m) / static_cast<double>(body.points.size());
  }
  for (const TargetPoint& point : body.points) {
    information += (Eigen::Vector3d(point.x_m, point.y_m, point.z_m) - middle_m).squaredNorm() /
                   (point.sigma_m * point.sigma_m);
  }
  EXPECT_NEAR(result.target.scale_sigma_rel * std::sqrt(information), 1, 0.1);
}

}  // namespace
}  // namespace rigcal::server::settled_scale_test
