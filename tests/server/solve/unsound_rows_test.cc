// SPDX-License-Identifier: Apache-2.0
#include "server/solve/unsound_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::unsound_rows_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

CalibrationInput Input(const std::string& options) {
  const auto world = SimulatedWorld::Create(*ParseSimulationOptions(options), WandTarget());
  EXPECT_THAT(world, IsOk());
  return InputOf(*world);
}

void Freeze(CameraTrack* track) {
  const auto markers = track->observations[100].markers;
  for (Observation& row : track->observations) row.markers = markers;
}

const Finding* Find(const CalibrationResult& result, FindingKind kind) {
  for (const Finding& finding : result.findings) {
    if (finding.kind == kind) return &finding;
  }
  return nullptr;
}

TEST(UnsoundRows, OfSoundCamerasNothingIsTaken) {
  CalibrationInput input = Input("cameras=3;duration=10");
  const std::vector<CameraTrack> before = input.tracks;
  RefusalCounter refused;
  const auto target_of = [&input](const std::string&) -> const Target& { return input.target; };
  const auto unsound = TakeUnsoundRows({}, target_of, &input, &refused);
  ASSERT_THAT(unsound, IsOk());
  EXPECT_THAT(unsound->findings, IsEmpty());
  EXPECT_THAT(unsound->left_out, IsEmpty());
  EXPECT_TRUE(refused.empty());
  ASSERT_THAT(input.tracks, SizeIs(3));
  for (size_t t = 0; t < 3; ++t) {
    EXPECT_EQ(input.tracks[t].observations.size(), before[t].observations.size());
  }
}

TEST(UnsoundRows, OfACopyOneCameraIsCalibratedAndBad) {
  CalibrationInput input = Input("cameras=4;duration=20");
  input.tracks[3].observations = input.tracks[1].observations;
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_THAT(outcome.result->cameras, SizeIs(3));
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kBad);
  const Finding* const finding = Find(*outcome.result, FindingKind::kRowsCopied);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->camera, "sim_3");
  EXPECT_EQ(finding->severity, FindingSeverity::kError);
  EXPECT_THAT(finding->advice, HasSubstr("same rows as sim_1"));
}

TEST(UnsoundRows, TwoCamerasWithOneFileAreRefusedWithTheCause) {
  CalibrationInput input = Input("cameras=2;duration=20");
  input.tracks[1].observations = input.tracks[0].observations;
  EXPECT_THAT(Calibrate(input, {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("camera sim_1"), HasSubstr("same rows as sim_0"),
                             HasSubstr("1 camera is left of 2"))));
}

TEST(UnsoundRows, ACameraThatTheOptionsNameCannotBeLeftOut) {
  CalibrationInput input = Input("cameras=4;duration=20");
  Freeze(&input.tracks[1]);
  CalibrationOptions options;
  options.reference_camera = "sim_1";
  EXPECT_THAT(Calibrate(input, options).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("camera sim_1"), HasSubstr("is frozen"),
                             HasSubstr("the options name it"))));
}

TEST(UnsoundRows, AFrozenCameraIsLeftOutAndTheOthersAreUsable) {
  CalibrationInput input = Input("cameras=4;duration=40");
  Freeze(&input.tracks[2]);
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_THAT(outcome.result->cameras, SizeIs(3));
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kUsable);
  const Finding* const finding = Find(*outcome.result, FindingKind::kRowsFrozen);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->camera, "sim_2");
  EXPECT_THAT(finding->advice, HasSubstr("the whole camera was left out"));
}

TEST(UnsoundRows, ClocksWithTwoBeginningsAreRelatedByTheMotion) {
  CalibrationInput input = Input("cameras=4;duration=40");
  const CalibrationOutcome before = Calibrate(input, {});
  for (const size_t t : {2, 3}) {
    for (Observation& row : input.tracks[t].observations) row.time_ns += 1'700'000'000'000'000'000;
    // It was started seven seconds later.
    std::erase_if(input.tracks[t].observations, [&](const Observation& row) {
      return row.time_ns < input.tracks[t].observations.front().time_ns + 7'000'000'000;
    });
  }
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(before.result, IsOk());
  ASSERT_THAT(outcome.result, IsOk());
  ASSERT_NE(Find(*outcome.result, FindingKind::kClockFoundByMotion), nullptr);
  EXPECT_NE(outcome.result->quality.grade, QualityGrade::kBad);
  for (size_t c = 0; c < 4; ++c) {
    EXPECT_LT((outcome.result->cameras[c].cam_from_rig.SourceFromTargetTranslation() -
               before.result->cameras[c].cam_from_rig.SourceFromTargetTranslation())
                  .norm(),
              0.002);
  }
}

TEST(UnsoundRows, ClocksWithTwoBeginningsThatNothingRelatesAreNamed) {
  CalibrationInput input = Input("cameras=4;duration=20");
  const CalibrationInput other = Input("cameras=4;duration=20;seed=9");
  for (const size_t t : {2, 3}) {
    input.tracks[t].observations = other.tracks[t].observations;
    for (Observation& row : input.tracks[t].observations) row.time_ns += 1'700'000'000'000'000'000;
  }
  EXPECT_THAT(Calibrate(input, {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("sim_0, sim_1 count from another beginning"),
                             HasSubstr("sim_2, sim_3 count since 1970"))));
}

}  // namespace
}  // namespace rigcal::server::unsound_rows_test
