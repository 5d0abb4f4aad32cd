// SPDX-License-Identifier: Apache-2.0
// Recordings that were disturbed in a known way: the cause is named, and no result that is wrong is
// good.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <string>

#include "common/camera/camera_model.h"
#include "common/simulation/world/simulated_world.h"
#include "server/solve/calibrate.h"
#include "tests/server/solve/recorded_input.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::disturbed_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::Ne;
using ::testing::SizeIs;

CalibrationInput Simulated(const std::string& options) {
  const auto parsed = ParseSimulationOptions(options);
  EXPECT_THAT(parsed, IsOk());
  const auto world = SimulatedWorld::Create(*parsed, WandTarget());
  EXPECT_THAT(world, IsOk());
  return InputOf(*world);
}

const Finding* Get(const CalibrationResult& result, FindingKind kind) {
  const auto found = std::ranges::find(result.findings, kind, &Finding::kind);
  return found == result.findings.end() ? nullptr : &*found;
}

// Adds to the stamps of one track what `added_s` says of its share of the recording.
void MoveStamps(const std::function<double(double share)>& added_s, CameraTrack* track) {
  const int64_t first_ns = track->observations.front().time_ns;
  const auto span_ns = static_cast<double>(track->observations.back().time_ns - first_ns);
  for (Observation& row : track->observations) {
    const double share = static_cast<double>(row.time_ns - first_ns) / span_ns;
    row.time_ns += std::llround(1e9 * added_s(share));
  }
}

void ForEachCentre(CameraTrack* track, const std::function<void(Eigen::Vector2d*)>& change) {
  for (Observation& row : track->observations) {
    for (MarkerObservation& marker : row.markers) {
      if (marker.visible) change(&marker.centre_px);
    }
  }
}

// The largest difference of a distance between two cameras.
double WorstDistanceM(const CalibrationResult& a, const CalibrationResult& b) {
  double worst_m = 0;
  const auto distance_m = [](const CalibrationResult& result, size_t c, size_t d) {
    return (result.cameras[c].cam_from_rig.SourceFromTargetTranslation() -
            result.cameras[d].cam_from_rig.SourceFromTargetTranslation())
        .norm();
  };
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    for (size_t d = 0; d < c; ++d) {
      worst_m = std::max(worst_m, std::abs(distance_m(a, c, d) - distance_m(b, c, d)));
    }
  }
  return worst_m;
}

TEST(DisturbedRecording, ClockThatJumpedIsNamedAndFollowed) {
  CalibrationInput input = Simulated("cameras=5;duration=40;seed=31");
  const CalibrationOutcome undisturbed = Calibrate(input, {});
  ASSERT_THAT(undisturbed.result, IsOk());
  MoveStamps([](double share) { return share < 0.5 ? 0 : 0.03; }, &input.tracks[1]);
  const CalibrationOutcome outcome = Calibrate(std::move(input), {});
  ASSERT_THAT(outcome.result, IsOk());
  const Finding* const jump = Get(*outcome.result, FindingKind::kClockJump);
  ASSERT_NE(jump, nullptr);
  EXPECT_EQ(jump->camera, "sim_1");
  // Later stamps: a more negative offset.
  EXPECT_NEAR(jump->value, -30, 1);
  EXPECT_THAT(jump->advice, HasSubstr("s after the first wand view its clock jumped by"));
  EXPECT_THAT(jump->advice, HasSubstr("the calibration follows it"));
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kGood);
  const ClockCourseLine& course = outcome.result->cameras[1].clock_course;
  ASSERT_THAT(course, SizeIs(4));
  EXPECT_EQ(course[0].offset_s, 0);
  EXPECT_EQ(course[1].offset_s, 0);
  EXPECT_NEAR(course[2].offset_s, -0.03, 2e-4);
  EXPECT_EQ(course[3].offset_s, course[2].offset_s);
  EXPECT_LT(WorstDistanceM(*undisturbed.result, *outcome.result), 5e-4);
  EXPECT_EQ(Get(*outcome.result, FindingKind::kCameraMoved), nullptr);
}

TEST(DisturbedRecording, AMarkerThatOneCameraSeesBesideItsPlaceIsNamed) {
  CalibrationInput input = Simulated("cameras=5;duration=40;seed=31");
  for (Observation& row : input.tracks[3].observations) {
    if (row.markers.size() > 1 && row.markers[1].visible) row.markers[1].centre_px.x() += 4;
  }
  const CalibrationOutcome outcome = Calibrate(std::move(input), {});
  ASSERT_THAT(outcome.result, IsOk());
  const Finding* const displaced = Get(*outcome.result, FindingKind::kNoisyCamera);
  ASSERT_NE(displaced, nullptr);
  EXPECT_EQ(displaced->camera, "sim_3");
  EXPECT_GT(displaced->value, 1.5);
  EXPECT_THAT(displaced->advice, AllOf(HasSubstr("marker 1 is seen"), HasSubstr("(x +")));
  EXPECT_NE(outcome.result->quality.grade, QualityGrade::kGood);
}

TEST(DisturbedRecording, ClockThatJumpedTwiceIsNamedAndFollowed) {
  CalibrationInput input = Simulated("cameras=5;duration=40;seed=31");
  const CalibrationOutcome undisturbed = Calibrate(input, {});
  ASSERT_THAT(undisturbed.result, IsOk());
  MoveStamps(
      [](double share) { return (share < 1.0 / 3 ? 0 : 0.02) + (share < 2.0 / 3 ? 0 : 0.025); },
      &input.tracks[1]);
  const CalibrationOutcome outcome = Calibrate(std::move(input), {});
  ASSERT_THAT(outcome.result, IsOk());
  const Finding* const jump = Get(*outcome.result, FindingKind::kClockJump);
  ASSERT_NE(jump, nullptr);
  EXPECT_EQ(jump->camera, "sim_1");
  EXPECT_NEAR(jump->value, -25, 1);
  EXPECT_THAT(jump->advice, HasSubstr("its clock jumped 2 times"));
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kGood);
  const ClockCourseLine& course = outcome.result->cameras[1].clock_course;
  ASSERT_THAT(course, SizeIs(6));
  EXPECT_NEAR(course[2].offset_s, -0.02, 1e-3);
  EXPECT_NEAR(course[5].offset_s, -0.045, 1e-3);
  EXPECT_LT(WorstDistanceM(*undisturbed.result, *outcome.result), 5e-4);
  EXPECT_EQ(Get(*outcome.result, FindingKind::kRollingShutter), nullptr);
}

TEST(DisturbedRecording, ClockWhoseRateChangesIsNamedAndFollowed) {
  CalibrationInput input = Simulated("cameras=5;duration=40;seed=32");
  const CalibrationOutcome undisturbed = Calibrate(input, {});
  ASSERT_THAT(undisturbed.result, IsOk());
  MoveStamps([](double share) { return 0.05 * share * share; }, &input.tracks[2]);
  const CalibrationOutcome outcome = Calibrate(std::move(input), {});
  ASSERT_THAT(outcome.result, IsOk());
  const Finding* const drift = Get(*outcome.result, FindingKind::kClockDrift);
  ASSERT_NE(drift, nullptr);
  EXPECT_EQ(drift->camera, "sim_2");
  EXPECT_FALSE(outcome.result->cameras[2].clock_course.empty());
  EXPECT_LT(WorstDistanceM(*undisturbed.result, *outcome.result), 5e-4);
  EXPECT_EQ(Get(*outcome.result, FindingKind::kClockJump), nullptr);
}

TEST(DisturbedRecording, TwoSecondsAreNeverUsable) {
  RIGCAL_REQUIRE_RECORDED_DATA(folder);
  auto input = RecordedInput(folder);
  ASSERT_THAT(input, IsOk());
  for (CameraTrack& track : input->tracks) {
    std::erase_if(track.observations, [](const Observation& row) {
      return row.time_ns < 30'000'000'000 || row.time_ns > 32'000'000'000;
    });
  }
  const CalibrationOutcome outcome = Calibrate(*std::move(input), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kBad);
  EXPECT_NE(Get(*outcome.result, FindingKind::kTooLittleData), nullptr);
}

TEST(DisturbedRecording, PredictedErrorAboveWhatIsAcceptedIsBad) {
  CalibrationOptions options;
  options.accept_m = 0.0003;
  const CalibrationOutcome strict = Calibrate(Simulated("cameras=4;duration=20;seed=33"), options);
  ASSERT_THAT(strict.result, IsOk());
  EXPECT_EQ(strict.result->quality.grade, QualityGrade::kBad);
  EXPECT_THAT(strict.result->quality.reasons,
              Contains(HasSubstr("predicted error of the camera positions")));
  EXPECT_EQ(strict.result->quality.accepted_error_m, 0.0003);
  EXPECT_GT(strict.result->quality.predicted_error_m, 0.0003);
  options.accept_m = 0.1;
  const CalibrationOutcome lenient = Calibrate(Simulated("cameras=4;duration=20;seed=33"), options);
  ASSERT_THAT(lenient.result, IsOk());
  EXPECT_NE(lenient.result->quality.grade, QualityGrade::kBad);
  EXPECT_EQ(lenient.result->quality.predicted_error_m, strict.result->quality.predicted_error_m);
}

TEST(DisturbedRecording, TenMillimetresInOneMarkerAreFound) {
  for (const std::vector<double>& positions_m :
       {std::vector<double>{0, 0.13, 0.40}, {0, 0.13, 0.38}, {0, 0.14, 0.39}, {0, 0.12, 0.39}}) {
    CalibrationInput input = Simulated("cameras=4;duration=20;seed=34");
    input.target.marker_positions_m = positions_m;
    const CalibrationOutcome outcome = Calibrate(std::move(input), {});
    ASSERT_THAT(outcome.result, IsOk());
    const Finding* const finding = Get(*outcome.result, FindingKind::kWrongWandLength);
    ASSERT_NE(finding, nullptr) << positions_m[1] << " " << positions_m[2];
    EXPECT_THAT(finding->advice, AllOf(HasSubstr("ratios of the spans only"), HasSubstr("scale")));
    EXPECT_NE(outcome.result->quality.grade, QualityGrade::kGood);
  }
}

TEST(DisturbedRecording, StampsInMillisecondsAreRefusedByName) {
  CalibrationInput input = Simulated("cameras=4;duration=20;seed=35");
  for (Observation& row : input.tracks[3].observations) row.time_ns /= 1'000'000;
  EXPECT_THAT(Calibrate(std::move(input), {}).result,
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera sim_3"), HasSubstr("milliseconds"))));
}

// The result is that of the others, and the finding names the camera.
void ExpectLeftOut(const CalibrationOutcome& outcome, const std::string& camera, FindingKind kind) {
  ASSERT_THAT(outcome.result, IsOk());
  const Finding* const finding = Get(*outcome.result, kind);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->camera, camera);
  EXPECT_EQ(finding->severity, FindingSeverity::kWarning);
  EXPECT_TRUE(std::isfinite(finding->value));
  EXPECT_THAT(finding->advice, HasSubstr("was left out"));
  EXPECT_THAT(outcome.result->cameras,
              AllOf(SizeIs(4), Each(Field(&CalibratedCamera::camera, Ne(camera)))));
  EXPECT_NE(outcome.result->quality.grade, QualityGrade::kBad);
  EXPECT_THAT(outcome.refused,
              Contains(AllOf(Field(&Refusal::camera, camera),
                             Field(&Refusal::example, HasSubstr("was left out")))));
}

TEST(DisturbedRecording, MirroredImageIsLeftOut) {
  CalibrationInput input = Simulated("cameras=5;duration=30;seed=36");
  const double width_px = input.tracks[2].camera.image_size_px.width;
  ForEachCentre(&input.tracks[2], [&](Eigen::Vector2d* centre_px) {
    centre_px->x() = width_px - 1 - centre_px->x();
  });
  ExpectLeftOut(Calibrate(std::move(input), {}), "sim_2", FindingKind::kMirroredImage);
}

CalibrationInput WithReversedCamera() {
  CalibrationInput input = Simulated("cameras=5;duration=30;seed=37");
  std::vector<Observation>& rows = input.tracks[1].observations;
  for (size_t i = 0; i < rows.size() / 2; ++i) {
    std::swap(rows[i].markers, rows[rows.size() - 1 - i].markers);
  }
  return input;
}

TEST(DisturbedRecording, CameraThatAgreesWithNoneIsLeftOut) {
  ExpectLeftOut(Calibrate(WithReversedCamera(), {}), "sim_1", FindingKind::kInconsistentCamera);
}

TEST(DisturbedRecording, TheReferenceCameraIsNotLeftOut) {
  CalibrationOptions options;
  options.reference_camera = "sim_1";
  const CalibrationOutcome outcome = Calibrate(WithReversedCamera(), options);
  if (outcome.result.ok()) {
    EXPECT_EQ(outcome.result->cameras.size(), 5);
    EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kBad);
  } else {
    EXPECT_THAT(outcome.result.status(),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr("camera sim_1"), HasSubstr("leave it out"))));
  }
}

// With refined intrinsics its two poses share a lens that is known far worse than they differ.
TEST(DisturbedRecording, TenthOfADegreeIsFoundInTheRealRecording) {
  RIGCAL_REQUIRE_RECORDED_DATA(folder);
  auto input = RecordedInput(folder);
  ASSERT_THAT(input, IsOk());
  CameraTrack& track = input->tracks[1];
  const int64_t middle_ns =
      track.observations.front().time_ns / 2 + track.observations.back().time_ns / 2;
  const Eigen::AngleAxisd turn(0.1 * M_PI / 180, Eigen::Vector3d::UnitY());
  for (Observation& row : track.observations) {
    if (row.time_ns < middle_ns) continue;
    for (MarkerObservation& marker : row.markers) {
      const auto ray = Undistort(*track.camera.intrinsics, marker.centre_px);
      if (!marker.visible || !ray.ok()) continue;
      Project(*track.camera.intrinsics, turn * ray->homogeneous(), &marker.centre_px);
    }
  }
  const std::string camera = track.camera.camera;
  const CalibrationOutcome outcome = Calibrate(*std::move(input), {});
  ASSERT_THAT(outcome.result, IsOk());
  const Finding* const moved = Get(*outcome.result, FindingKind::kCameraMoved);
  ASSERT_NE(moved, nullptr);
  EXPECT_EQ(moved->camera, camera);
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kBad);
}

// Three percent are one and a half sigmas of what is given, and many of the data's.
TEST(DisturbedRecording, FocalLengthThatWasKeptThoughWrongIsNotUsable) {
  CalibrationInput input = Simulated("cameras=5;duration=30;seed=39");
  input.tracks[1].camera.intrinsics->fx_px *= 1.03;
  input.tracks[1].camera.intrinsics->fy_px *= 1.03;
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(std::move(input), options);
  ASSERT_THAT(outcome.result, IsOk());
  const Finding* const wrong = Get(*outcome.result, FindingKind::kWrongIntrinsics);
  ASSERT_NE(wrong, nullptr);
  EXPECT_EQ(wrong->camera, "sim_1");
  EXPECT_NE(outcome.result->quality.grade, QualityGrade::kGood);
}

TEST(DisturbedRecording, GarbageHasNoFigures) {
  CalibrationInput input = Simulated("cameras=3;duration=20;seed=38");
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(0, 1000);
  for (CameraTrack& track : input.tracks) {
    ForEachCentre(&track, [&](Eigen::Vector2d* centre_px) {
      *centre_px = {place(random), place(random)};
    });
  }
  const CalibrationOutcome outcome = Calibrate(std::move(input), {});
  if (!outcome.result.ok()) return;  // refused, which is as well
  EXPECT_EQ(outcome.result->quality.grade, QualityGrade::kBad);
  for (const Finding& finding : outcome.result->findings) {
    if (finding.kind == FindingKind::kClockOffset ||
        finding.kind == FindingKind::kWrongIntrinsics) {
      EXPECT_TRUE(finding.candidate) << finding.advice;
    }
    EXPECT_THAT(finding.advice, ::testing::Not(HasSubstr("+-0.00")));
  }
}

}  // namespace
}  // namespace rigcal::server::disturbed_test
