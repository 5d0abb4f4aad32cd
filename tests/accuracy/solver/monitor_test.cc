// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

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
  const Eigen::Vector3d turn_rad = 0.1 * M_PI / 180 * Eigen::Vector3d(1, 1, 0.3).normalized();
  const RecordingTrial trial = RunRecordingTrial(*whole, whole->tracks.size() - 1, turn_rad);
  ASSERT_THAT(trial.status, IsOk());
  EXPECT_EQ(trial.quiet_problem, "");
  EXPECT_THAT(trial.quiet_moved, ElementsAre());
  EXPECT_EQ(trial.problem, "");
  EXPECT_THAT(trial.moved, ElementsAre(trial.camera));
  ASSERT_TRUE(trial.repaired) << trial.repair_problem;
  EXPECT_NEAR(trial.back.rotation_rad, turn_rad.norm(), 3 * trial.back.rotation_sigma_rad);
  EXPECT_LT(trial.back.translation_m, 3 * trial.back.translation_sigma_m);
  EXPECT_LT(trial.others_moved_m, 1e-9);
}

}  // namespace
}  // namespace rigcal::accuracy::monitor_test
