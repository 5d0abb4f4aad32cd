// SPDX-License-Identifier: Apache-2.0
// Cameras whose clocks have nothing in common, started by hand: their motion says when.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "server/solve/calibrate.h"
#include "server/solve/diagnose/readable_time.h"
#include "tests/server/solve/recorded_input.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::calibrate_starts_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

CalibrationInput Input(const std::string& options) {
  const auto world = SimulatedWorld::Create(*ParseSimulationOptions(options), WandTarget());
  EXPECT_THAT(world, IsOk());
  return InputOf(*world);
}

void MoveStamps(double by_s, CameraTrack* track) {
  for (Observation& row : track->observations) row.time_ns += std::llround(1e9 * by_s);
}

CalibrationOptions KeepIntrinsics() {
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  return options;
}

// The camera's offset, against the others' median, when its stamps have been moved by -`by_s`.
void ExpectOffsets(const CalibrationResult& result, const std::vector<double>& offsets_s) {
  const double median_s = Median(offsets_s);
  ASSERT_EQ(result.cameras.size(), offsets_s.size());
  for (size_t c = 0; c < offsets_s.size(); ++c) {
    EXPECT_NEAR(result.cameras[c].time_offset_s, offsets_s[c] - median_s, 0.5e-3) << c;
  }
}

const Finding* FindKind(const CalibrationResult& result, FindingKind kind) {
  const auto found = std::ranges::find(result.findings, kind, &Finding::kind);
  return found == result.findings.end() ? nullptr : &*found;
}

class OneClockOff : public ::testing::TestWithParam<double> {};

TEST_P(OneClockOff, IsFoundAndNamed) {
  CalibrationInput input = Input("cameras=4;duration=40");
  MoveStamps(-GetParam(), &input.tracks[2]);
  const CalibrationOutcome outcome = Calibrate(std::move(input), KeepIntrinsics());
  ASSERT_THAT(outcome.result, IsOk());
  ExpectOffsets(*outcome.result, {0, 0, GetParam(), 0});
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kGood);
  const Finding* finding = FindKind(*outcome.result, FindingKind::kClockFoundByMotion);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->camera, "sim_2");
  // To 5 ms, in the unit that people read.
  const ReadableTime expected = ReadableTimeOf(GetParam());
  EXPECT_EQ(finding->unit, expected.unit);
  EXPECT_NEAR(finding->value, expected.value, 5e-3 * expected.value / GetParam());
  EXPECT_EQ(FindKind(*outcome.result, FindingKind::kPeriodicMotion), nullptr);
}

INSTANTIATE_TEST_SUITE_P(CalibrateStarts, OneClockOff, ::testing::Values(1.5, -3.0, 30.0, 600.0));

TEST(CalibrateStarts, OfAPointTooIsFound) {
  Target point;
  point.kind = TargetKind::kPoint;
  point.marker_positions_m = {0};
  const auto world =
      SimulatedWorld::Create(*ParseSimulationOptions("cameras=4;duration=40"), point);
  ASSERT_THAT(world, IsOk());
  CalibrationInput input = InputOf(*world);
  MoveStamps(-12, &input.tracks[1]);
  const CalibrationOutcome outcome = Calibrate(std::move(input), KeepIntrinsics());
  ASSERT_THAT(outcome.result, IsOk());
  ExpectOffsets(*outcome.result, {0, 12, 0, 0});
}

TEST(CalibrateStarts, OfAnAlignedRigNothingIsSaid) {
  const CalibrationOutcome outcome = Calibrate(Input("cameras=3;duration=20"), KeepIntrinsics());
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(FindKind(*outcome.result, FindingKind::kClockFoundByMotion), nullptr);
  EXPECT_EQ(FindKind(*outcome.result, FindingKind::kPeriodicMotion), nullptr);
}

// A wave that repeats itself exactly every second.
CalibrationInput PeriodicInput() {
  const auto world = SimulatedWorld::Create(
      *ParseSimulationOptions("cameras=3;duration=30;rate=50"), WandTarget());
  EXPECT_THAT(world, IsOk());
  CalibrationInput input = InputOf(*world);
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < world->FrameCount(c); ++i) {
      const double phase = 2 * M_PI * world->FrameRigTime(c, i);
      // Through most of the volume, turning.
      const Eigen::Vector3d middle(0.6 * std::sin(phase), 0.5 * std::sin(2 * phase + 1),
                                   1.2 + 0.4 * std::sin(3 * phase + 2));
      const Eigen::Vector3d direction =
          Eigen::Vector3d(std::cos(phase), std::sin(phase), std::sin(2 * phase)).normalized();
      input.tracks[static_cast<size_t>(c)].observations[static_cast<size_t>(i)] =
          world->ObserveWand(c, i, {middle - 0.195 * direction, direction});
    }
  }
  return input;
}

TEST(CalibrateStarts, AMotionThatRepeatsItselfIsRefusedWhereItAloneCouldTell) {
  CalibrationInput input = PeriodicInput();
  MoveStamps(-17.4, &input.tracks[1]);
  EXPECT_THAT(Calibrate(std::move(input), KeepIntrinsics()).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("sim_1"), HasSubstr("repeats itself"),
                             HasSubstr("without a rhythm"))));
}

// Its stamps look aligned, and nothing says that they are not.
TEST(CalibrateStarts, AClockThatIsAPeriodOffIsNeverGood) {
  CalibrationInput input = PeriodicInput();
  MoveStamps(-1, &input.tracks[1]);
  const CalibrationOutcome outcome = Calibrate(std::move(input), KeepIntrinsics());
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_NE(outcome.result->quality.grade, QualityGrade::kGood);
  const Finding* finding = FindKind(*outcome.result, FindingKind::kPeriodicMotion);
  ASSERT_NE(finding, nullptr);
  EXPECT_NEAR(finding->value, 1, 0.03);
}

// The motion may be why, and is named with whatever else stops the solve.
TEST(CalibrateStarts, OfAPeriodicMotionAFailedSolveSaysSo) {
  CalibrationInput input = PeriodicInput();
  std::vector<Observation>& rows = input.tracks[2].observations;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (i % 10 == 0 && i < 50) continue;
    for (MarkerObservation& marker : rows[i].markers) marker.visible = false;
  }
  EXPECT_THAT(Calibrate(std::move(input), KeepIntrinsics()).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("sim_2"), HasSubstr("repeats itself every 1.00 s"))));
}

// The four cameras of the recording, whose positions may differ by `tolerance` in the unit of the
// results.
void ExpectSamePositions(const CalibrationResult& before, const CalibrationResult& after,
                         double tolerance) {
  ASSERT_EQ(before.cameras.size(), 4u);
  ASSERT_EQ(after.cameras.size(), 4u);
  for (size_t c = 0; c < 4; ++c) {
    EXPECT_LT((before.cameras[c].cam_from_rig.SourceFromTargetTranslation() -
               after.cameras[c].cam_from_rig.SourceFromTargetTranslation())
                  .norm(),
              tolerance)
        << c;
  }
}

// Its middle marker alone, one camera 3 s off: once 3.3 m wrong.
TEST(CalibrateStarts, OfOneRecordedMarkerTooAreAsIfItsClocksWereOne) {
  RIGCAL_REQUIRE_RECORDED_DATA(folder);
  auto input = RecordedInput(folder);
  ASSERT_THAT(input, IsOk());
  input->target.kind = TargetKind::kPoint;
  input->target.marker_positions_m = {0};
  for (CameraTrack& track : input->tracks) {
    for (Observation& row : track.observations) row.markers = {row.markers[1]};
  }
  const CalibrationOutcome before = Calibrate(*input, {});
  MoveStamps(3, &input->tracks[2]);
  const CalibrationOutcome after = Calibrate(*input, {});
  ASSERT_THAT(before.result, IsOk());
  ASSERT_THAT(after.result, IsOk());
  // The unit of a point's rig is about 6 m here.
  ExpectSamePositions(*before.result, *after.result, 1e-6);
}

TEST(CalibrateStarts, OfTheRecordingAreAsIfItsClocksWereOne) {
  RIGCAL_REQUIRE_RECORDED_DATA(folder);
  auto input = RecordedInput(folder);
  ASSERT_THAT(input, IsOk());
  const CalibrationOutcome before = Calibrate(*input, {});
  const double moved_s[] = {-11.3, 30, -0.85, 23.456};
  for (size_t c = 0; c < 4; ++c) MoveStamps(moved_s[c], &input->tracks[c]);
  const CalibrationOutcome after = Calibrate(*input, {});
  ASSERT_THAT(before.result, IsOk());
  ASSERT_THAT(after.result, IsOk());
  ExpectSamePositions(*before.result, *after.result, 1e-5);
  const auto offset_from_first_s = [](const CalibrationResult& result, size_t c) {
    return result.cameras[c].time_offset_s - result.cameras[0].time_offset_s;
  };
  for (size_t c = 0; c < 4; ++c) {
    EXPECT_NEAR(offset_from_first_s(*after.result, c) - offset_from_first_s(*before.result, c),
                moved_s[0] - moved_s[c], 1e-5)
        << c;
  }
}

}  // namespace
}  // namespace rigcal::server::calibrate_starts_test
