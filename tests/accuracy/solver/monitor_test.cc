// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "server/solve/evaluate/rig_difference.h"
#include "tests/accuracy/solver/halves_experiment.h"
#include "tests/accuracy/solver/monitor_experiment.h"
#include "tests/server/solve/recorded_input.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::monitor_test {
namespace {

using ::rigcal::testing::IsOk;
using ::testing::ElementsAre;

constexpr uint32_t kSeed = 7001;  // not one of the table

TEST(Monitor, NamesRepairsAndIsQuietOtherwise) {
  MonitorOptions options;
  options.duration_s = 30;
  const MonitorTrial trial = RunMonitorTrial(options, kSeed);
  ASSERT_THAT(trial.status, IsOk());
  EXPECT_TRUE(trial.quiet_moved.empty());
  EXPECT_EQ(trial.quiet_problem, "");
  for (const BumpOutcome* bump : {&trial.turn, &trial.shift}) {
    EXPECT_THAT(bump->moved, ElementsAre(bump->camera)) << bump->problem;
    EXPECT_TRUE(bump->repaired) << bump->problem;
    EXPECT_TRUE(bump->good);
    EXPECT_LT(bump->others_moved_m, 1e-9);
    // Small beside the bump; the experiment says how small on average.
    EXPECT_LT(bump->repaired_error_m, 0.5 * options.shift_m);
  }
}

// The real recording in two halves, in the second of which one camera's rows are turned by 0.1
// degrees about its centre.
TEST(Monitor, FindsACameraTurnedInTheSecondHalfOfARealRecording) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  const absl::StatusOr<server::CalibrationInput> whole = server::RecordedInput(data);
  ASSERT_THAT(whole, IsOk());
  const PartsOptions halves{.count = 2};
  const server::CalibrationOutcome first =
      server::Calibrate(TakePart(*whole, halves, 0), CalibrationOptions());
  ASSERT_THAT(first.result, IsOk());
  server::CalibrationInput second = TakePart(*whole, halves, 1);
  const server::CalibrationOutcome quiet = server::Calibrate(second, LookOptions(*first.result));
  ASSERT_THAT(quiet.result, IsOk());
  const auto nothing = server::CompareRigs(*first.result, *quiet.result);
  ASSERT_THAT(nothing, IsOk());
  EXPECT_EQ(nothing->problem, "");
  EXPECT_THAT(nothing->Moved(), ElementsAre());

  const Eigen::Vector3d turn_rad = 0.1 * M_PI / 180 * Eigen::Vector3d(1, 1, 0.3).normalized();
  server::CameraTrack& track = second.tracks.back();
  const std::string camera = track.camera.camera;
  TurnRows(turn_rad, &track);
  const server::CalibrationOutcome now = server::Calibrate(second, LookOptions(*first.result));
  ASSERT_THAT(now.result, IsOk());
  const auto difference = server::CompareRigs(*first.result, *now.result);
  ASSERT_THAT(difference, IsOk());
  EXPECT_EQ(difference->problem, "");
  EXPECT_THAT(difference->Moved(), ElementsAre(camera));

  second.parent = *first.result;
  const server::CalibrationOutcome repaired = server::Calibrate(second, RepairOptions(camera));
  ASSERT_THAT(repaired.result, IsOk());
  const auto back = server::CompareRigs(*first.result, *repaired.result);
  ASSERT_THAT(back, IsOk());
  for (const server::CameraDifference& each : back->cameras) {
    if (each.camera != camera) {
      EXPECT_LT(each.translation_m, 1e-9) << each.camera;
      continue;
    }
    EXPECT_NEAR(each.rotation_rad, turn_rad.norm(), 3 * each.rotation_sigma_rad);
    EXPECT_LT(each.translation_m, 3 * each.translation_sigma_m);
  }
}

}  // namespace
}  // namespace rigcal::accuracy::monitor_test
