// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bad_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "common/camera/camera_model.h"
#include "server/solve/rig/rig_solver.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::bad_rows_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

SimulatedWorld World(const std::string& options) {
  const auto world = SimulatedWorld::Create(*ParseSimulationOptions(options), WandTarget());
  EXPECT_THAT(world, IsOk());
  return *world;
}

// Of the rows, `share` show something else, anywhere.
void Scatter(double share, CameraTrack* track) {
  std::mt19937 random(11);
  std::bernoulli_distribution chosen(share);
  std::uniform_real_distribution<double> at_px(0, 1000);
  for (Observation& row : track->observations) {
    if (!chosen(random)) continue;
    for (MarkerObservation& marker : row.markers) marker.centre_px = {at_px(random), at_px(random)};
  }
}

BadRows BadRowsOf(const CalibrationInput& input) {
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(input, &clocks);
  const auto solution = SolveRig(rig, clocks, {});
  EXPECT_THAT(solution, IsOk());
  return FindBadRows(rig, *solution);
}

TEST(BadRows, OfASoundRecordingThereAreNone) {
  const BadRows bad = BadRowsOf(InputOf(World("cameras=4;duration=20")));
  EXPECT_THAT(bad.findings, IsEmpty());
  for (const auto& rows : bad.rows) EXPECT_THAT(rows, IsEmpty());
}

TEST(BadRows, AreTakenOfTheCameraWhoseDetectorIsBadOnly) {
  CalibrationInput input = InputOf(World("cameras=4;duration=20"));
  Scatter(0.3, &input.tracks[2]);
  const BadRows bad = BadRowsOf(input);
  ASSERT_THAT(bad.findings, SizeIs(1));
  EXPECT_EQ(bad.findings[0].kind, FindingKind::kOutliersInCamera);
  EXPECT_EQ(bad.findings[0].camera, "sim_2");
  EXPECT_NEAR(bad.findings[0].value, 30, 5);
  EXPECT_THAT(bad.rows[0], IsEmpty());
  EXPECT_THAT(bad.rows[1], IsEmpty());
  EXPECT_GT(bad.rows[2].size(), 100u);
  EXPECT_THAT(bad.rows[3], IsEmpty());
}

// One piece is what a camera leaves behind that was touched, or a clock that jumped.
TEST(BadRows, InOnePieceAreLeftToOtherCauses) {
  CalibrationInput input = InputOf(World("cameras=4;duration=20"));
  std::vector<Observation>& rows = input.tracks[2].observations;
  for (size_t i = 2 * rows.size() / 3; i < rows.size(); ++i) {
    for (MarkerObservation& marker : rows[i].markers) marker.centre_px.x() += 150;
  }
  EXPECT_THAT(BadRowsOf(input).findings, IsEmpty());
}

TEST(BadRows, TheCalibrationWithoutThemIsRightAndUsable) {
  const SimulatedWorld world = World("cameras=4;duration=40");
  CalibrationInput input = InputOf(world);
  Scatter(0.3, &input.tracks[2]);
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kUsable);
  EXPECT_LT(ComparePoses(*outcome.result, world).worst_position_m, 0.003);
}

// In every other second two cameras see where the wand is five seconds later.
TEST(BadRows, ASecondWandIsNamedWithWhoSeesIt) {
  CalibrationInput input = InputOf(World("cameras=5;duration=40"));
  for (const size_t t : {1, 2}) {
    std::vector<Observation>& rows = input.tracks[t].observations;
    for (size_t i = 0; i + 125 < rows.size(); ++i) {
      if (i / 25 % 3 == 0) rows[i].markers = rows[i + 125].markers;
    }
  }
  const BadRows bad = BadRowsOf(input);
  ASSERT_THAT(bad.findings, SizeIs(2));
  for (const Finding& finding : bad.findings) {
    EXPECT_EQ(finding.kind, FindingKind::kSecondWandSeen);
    EXPECT_GT(finding.value, 10);
  }
  EXPECT_EQ(bad.findings[0].camera, "sim_1");
  EXPECT_THAT(bad.findings[0].advice, HasSubstr("it and sim_2"));
}

}  // namespace
}  // namespace rigcal::server::bad_rows_test
