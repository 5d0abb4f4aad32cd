// SPDX-License-Identifier: Apache-2.0
// Errors and findings of recordings from which no rig can be solved, or only badly: who,
// with whom, and what to do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::calibrate_errors_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

CalibrationInput Input(const std::string& options) {
  const auto world = SimulatedWorld::Create(*ParseSimulationOptions(options), WandTarget());
  EXPECT_THAT(world, IsOk());
  return InputOf(*world);
}

std::vector<FindingKind> KindsOf(const CalibrationResult& result) {
  std::vector<FindingKind> kinds;
  for (const Finding& finding : result.findings) kinds.push_back(finding.kind);
  return kinds;
}

// The wand hangs still in the room while it sways by some pixels in every image.
TEST(CalibrateErrors, AWandThatWasHardlyMovedIsNamedWithWhereItWas) {
  CalibrationInput input = Input("cameras=3;duration=20");
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.3);
  for (CameraTrack& track : input.tracks) {
    const auto seen = std::find_if(track.observations.begin(), track.observations.end(),
                                   [](const Observation& row) { return row.VisibleCount() == 3; });
    ASSERT_NE(seen, track.observations.end());
    const auto markers = seen->markers;
    for (size_t i = 0; i < track.observations.size(); ++i) {
      const double t = static_cast<double>(i);
      const Eigen::Vector2d sway_px(40 * std::sin(0.13 * t), 40 * std::sin(0.0771 * t));
      track.observations[i].markers = markers;
      for (MarkerObservation& marker : track.observations[i].markers) {
        marker.centre_px += sway_px + Eigen::Vector2d(noise(random), noise(random));
      }
    }
  }
  EXPECT_THAT(Calibrate(input, {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("not connected"), HasSubstr("would best join them"),
                             HasSubstr("hardly moved"), HasSubstr(" degrees)"),
                             HasSubstr("turning and moving it in depth"))));
}

TEST(CalibrateErrors, OneMarkerOfAWandIsNoWand) {
  CalibrationInput input = Input("cameras=3;duration=20");
  for (CameraTrack& track : input.tracks) {
    for (Observation& row : track.observations) {
      for (size_t m = 1; m < row.markers.size(); ++m) row.markers[m].visible = false;
    }
  }
  EXPECT_THAT(Calibrate(input, {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("two markers of the wand at once"), HasSubstr("marker 0)"),
                             HasSubstr("--target point"))));
}

TEST(CalibrateErrors, CamerasThatSawNothingAreCounted) {
  CalibrationInput input = Input("cameras=3;duration=20");
  for (CameraTrack& track : input.tracks) {
    for (Observation& row : track.observations) {
      for (MarkerObservation& marker : row.markers) marker.visible = false;
    }
  }
  EXPECT_THAT(Calibrate(input, {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("camera sim_0 never saw the wand"),
                             HasSubstr("nor did 2 other cameras"))));
}

TEST(CalibrateErrors, ACameraThatContradictsAllOthersIsNamedWithTheLikelyCauses) {
  // Of three, none is left out: two are no rig to judge the third by.
  CalibrationInput input = Input("cameras=3;duration=20");
  input.tracks[2].observations = Input("cameras=3;duration=20;seed=9").tracks[2].observations;
  EXPECT_THAT(Calibrate(input, {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("{sim_2 (500 wand views)}"), HasSubstr("and sim_2 would"),
                             HasSubstr("clocks that are apart"), HasSubstr("intrinsics"),
                             HasSubstr("marker positions"))));
}

TEST(CalibrateErrors, ACameraThatContradictsThreeOthersIsLeftOut) {
  CalibrationInput input = Input("cameras=4;duration=20");
  input.tracks[2].observations = Input("cameras=4;duration=20;seed=9").tracks[2].observations;
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(outcome.result->cameras.size(), 3);
  EXPECT_THAT(KindsOf(*outcome.result), Contains(FindingKind::kInconsistentCamera).Times(1));
}

TEST(CalibrateErrors, CamerasThatRanAtOtherTimesAreNamedWithTheTimeBetween) {
  CalibrationInput input = Input("cameras=2;duration=20");
  // Another wave: nothing that both saw.
  input.tracks[1].observations = Input("cameras=2;duration=20;seed=9").tracks[1].observations;
  for (Observation& row : input.tracks[1].observations) row.time_ns += 100'000'000'000;
  EXPECT_THAT(Calibrate(input, {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("cameras sim_0 and sim_1 come nearest"),
                             HasSubstr("80.04 s apart"), HasSubstr("at the same time"))));
}

// All over its image, but six times only.
TEST(CalibrateErrors, TooFewSharedInstantsAreCountedAndPlaced) {
  CalibrationInput input = Input("cameras=3;duration=20");
  for (size_t i = 0; i < input.tracks[2].observations.size(); ++i) {
    if (i % 84 != 0) input.tracks[2].observations[i].markers.clear();
  }
  EXPECT_THAT(
      Calibrate(input, {}).result,
      StatusIs(
          absl::StatusCode::kFailedPrecondition,
          AllOf(HasSubstr("sim_2 (6 wand views)"), HasSubstr("they share 6 wand views"),
                HasSubstr("at least 8 are needed"), HasSubstr("of sim_2's image"),
                HasSubstr("wave the wand where both of them see it"), Not(HasSubstr("disagree")))));
}

// The second camera stands where the first one does.
TEST(CalibrateErrors, CamerasInOnePlaceAreCalibratedAndNamed) {
  CalibrationInput input = Input("cameras=2;duration=20");
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.3);
  input.tracks[1].observations = input.tracks[0].observations;
  input.tracks[1].camera.intrinsics = input.tracks[0].camera.intrinsics;
  for (Observation& row : input.tracks[1].observations) {
    for (MarkerObservation& marker : row.markers) {
      marker.centre_px += Eigen::Vector2d(noise(random), noise(random));
    }
  }
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_THAT(KindsOf(*outcome.result), Contains(FindingKind::kNarrowBaseline).Times(1));
  // Nothing says how far the cameras are from the wand.
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kBad);
  EXPECT_THAT(outcome.result->quality.reasons, Contains(HasSubstr("how accurate it is")));
}

TEST(CalibrateErrors, ALongWaveHasNoSuchFindings) {
  const CalibrationOutcome outcome = Calibrate(Input("cameras=3;duration=20"), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_THAT(KindsOf(*outcome.result), AllOf(Not(Contains(FindingKind::kNarrowBaseline)),
                                              Not(Contains(FindingKind::kLoosePose)),
                                              Not(Contains(FindingKind::kRestarted))));
}

// It takes part in less than half a second of the wave, with noisy centres.
TEST(CalibrateErrors, APoseThatIsHeldLooselyIsNamedWithWhereToWave) {
  CalibrationInput input = Input("cameras=3;duration=20;noise=0.8");
  std::vector<Observation>& rows = input.tracks[2].observations;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (i < 100 || i >= 110) rows[i].markers.clear();
  }
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  std::vector<std::string> loose, advice;
  for (const Finding& finding : outcome.result->findings) {
    if (finding.kind != FindingKind::kLoosePose) continue;
    loose.push_back(finding.camera);
    advice.push_back(finding.advice);
    EXPECT_GT(finding.value, 15);
  }
  EXPECT_THAT(loose, ElementsAre("sim_2"));
  EXPECT_THAT(advice, Contains(AllOf(HasSubstr("of sim_2's image ("), HasSubstr("and in the "),
                                     HasSubstr("Wave the wand where it and sim_"))));
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kBad);
  EXPECT_THAT(outcome.result->quality.reasons,
              Contains(HasSubstr("camera sim_2 sees the wand in")));
}

// Ten rows of one moment fit a pose that is centimetres off, and nothing contradicts it.
TEST(CalibrateErrors, ACameraOfOneMomentIsBadHoweverWellItFits) {
  CalibrationInput input = Input("cameras=3;duration=20");
  std::vector<Observation>& rows = input.tracks[2].observations;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (i < 100 || i >= 110) rows[i].markers.clear();
  }
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kBad);
  EXPECT_THAT(outcome.result->findings,
              Contains(AllOf(::testing::Field(&Finding::kind, FindingKind::kTooLittleData),
                             ::testing::Field(&Finding::camera, "sim_2"))));
}

}  // namespace
}  // namespace rigcal::server::calibrate_errors_test
