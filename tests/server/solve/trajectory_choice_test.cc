// SPDX-License-Identifier: Apache-2.0
// The whole solve with the target followed through time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::trajectory_choice_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

SimulatedWorld WorldOf(std::string_view text, const Target& target) {
  absl::StatusOr<SimulationOptions> options = ParseSimulationOptions(text);
  EXPECT_THAT(options, IsOk());
  absl::StatusOr<SimulatedWorld> world = SimulatedWorld::Create(*options, target);
  EXPECT_THAT(world, IsOk());
  return *std::move(world);
}

CalibrationOptions With(TrajectoryChoice trajectory) {
  CalibrationOptions options;
  options.trajectory = trajectory;
  return options;
}

// Free-running cameras at 8 Hz: interpolation leaves something out.
constexpr std::string_view kSlowCameras =
    "cameras=4;duration=25;rate=8;free_running=true;offset.1=0.004;offset.3=-0.003;seed=3";

TEST(TrajectoryChoice, ASplineIsUsedWhereItIsAskedFor) {
  const SimulatedWorld world = WorldOf(kSlowCameras, WandTarget());
  const CalibrationOutcome outcome = Calibrate(InputOf(world), With(TrajectoryChoice::kSpline));
  ASSERT_THAT(outcome.result, IsOk());
  const CalibratedTrajectory& trajectory = outcome.result->trajectory;
  EXPECT_EQ(trajectory.kind, CalibratedTrajectory::Kind::kSpline);
  EXPECT_GE(trajectory.knot_spacing_s, 0.02);
  EXPECT_GT(trajectory.jerk_density, 0);
  EXPECT_GT(trajectory.held_out_spline_px, 0);
  // Half of what stamps in one frame's time of each other would cost without any model.
  EXPECT_LT(ComparePoses(*outcome.result, world).worst_position_m, 0.004);
  for (const CalibratedCamera& camera : outcome.result->cameras) {
    ASSERT_TRUE(camera.uncertainty);
    EXPECT_LT(camera.uncertainty->time_offset_sigma_s, 0.5e-3);
  }
}

TEST(TrajectoryChoice, InterpolatedMeansInterpolated) {
  const SimulatedWorld world = WorldOf(kSlowCameras, WandTarget());
  const CalibrationOutcome outcome =
      Calibrate(InputOf(world), With(TrajectoryChoice::kInterpolated));
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(outcome.result->trajectory.kind, CalibratedTrajectory::Kind::kInterpolated);
  EXPECT_EQ(outcome.result->trajectory.held_out_spline_px, 0);
}

TEST(TrajectoryChoice, CamerasThatRunTogetherAreInterpolated) {
  const SimulatedWorld world = WorldOf("cameras=4;duration=15;seed=3", WandTarget());
  const CalibrationOutcome outcome = Calibrate(InputOf(world), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(outcome.result->trajectory.kind, CalibratedTrajectory::Kind::kInterpolated);
  EXPECT_EQ(outcome.result->trajectory.held_out_spline_px, 0);
}

TEST(TrajectoryChoice, ARigidTargetHasNone) {
  Target body;
  body.kind = TargetKind::kRigid;
  for (int i = 0; i < 6; ++i) {
    body.points.push_back(
        {absl::StrCat("p", i), 0.1 * std::sin(2.1 * i), 0.1 * std::cos(1.3 * i), 0.03 * i, 0.001});
  }
  CalibrationInput input = InputOf(WorldOf("cameras=3;duration=5;seed=1", body));
  EXPECT_THAT(Calibrate(std::move(input), With(TrajectoryChoice::kSpline)).result,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rigid target")));
}

TEST(TrajectoryChoice, EqualInputGivesEqualBits) {
  const SimulatedWorld world =
      WorldOf("cameras=3;duration=12;rate=8;free_running=true;seed=5", WandTarget());
  const CalibrationOutcome a = Calibrate(InputOf(world), With(TrajectoryChoice::kSpline));
  const CalibrationOutcome b = Calibrate(InputOf(world), With(TrajectoryChoice::kSpline));
  ASSERT_THAT(a.result, IsOk());
  ASSERT_THAT(b.result, IsOk());
  for (size_t c = 0; c < a.result->cameras.size(); ++c) {
    EXPECT_EQ(a.result->cameras[c].cam_from_rig.translation_m,
              b.result->cameras[c].cam_from_rig.translation_m);
  }
  EXPECT_EQ(a.result->camera_covariance, b.result->camera_covariance);
  EXPECT_EQ(a.result->observation_digest, b.result->observation_digest);
}

}  // namespace
}  // namespace rigcal::server::trajectory_choice_test
