// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/findings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_model.h"
#include "server/solve/calibrate.h"
#include "tests/server/solve/recorded_input.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::findings_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::testing::HasSubstr;

SimulatedWorld World(const std::string& options) {
  const auto parsed = ParseSimulationOptions(options);
  EXPECT_THAT(parsed, IsOk());
  auto world = SimulatedWorld::Create(*parsed, WandTarget());
  EXPECT_THAT(world, IsOk());
  return *std::move(world);
}

// Everything as given: what is wrong must be found, and not repaired.
CalibrationOptions Fixed() {
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  return options;
}

CalibrationResult Solve(const CalibrationInput& input, const CalibrationOptions& options) {
  const CalibrationOutcome outcome = Calibrate(input, options);
  EXPECT_THAT(outcome.result, IsOk());
  return outcome.result.ok() ? *outcome.result : CalibrationResult();
}

// Kind and camera of what is not merely informational.
std::multiset<std::string> Alarms(const CalibrationResult& result) {
  std::multiset<std::string> alarms;
  for (const Finding& finding : result.findings) {
    if (finding.kind == FindingKind::kIntrinsicsKept ||
        finding.kind == FindingKind::kIntrinsicsRefined)
      continue;
    alarms.insert(absl::StrCat(std::string(NameOf(finding.kind)), ":", finding.camera));
  }
  return alarms;
}

using Strings = std::multiset<std::string>;

Finding Get(const CalibrationResult& result, FindingKind kind) {
  for (const Finding& finding : result.findings) {
    if (finding.kind == kind) return finding;
  }
  ADD_FAILURE() << "no finding " << kind;
  return {};
}

// Centres of the markers of its frame `i`, without noise.
std::vector<Eigen::Vector2d> Projections(const SimulatedWorld& world, int c, double rig_time_s,
                                         const RigidTransform& cam_from_rig) {
  const WandPose wand = world.WandAt(rig_time_s);
  std::vector<Eigen::Vector2d> pixels;
  for (const double s_m : world.true_target().marker_positions_m) {
    Eigen::Vector2d pixel(NAN, NAN);
    Project(world.cameras()[static_cast<size_t>(c)].true_intrinsics,
            cam_from_rig * Eigen::Vector3d(wand.origin_m + s_m * wand.direction), &pixel);
    pixels.push_back(pixel);
  }
  return pixels;
}

// Adds to every centre of camera `c` what `shift` says of frame, marker and centre.
void ShiftCentres(
    const SimulatedWorld& world, int c,
    const std::function<Eigen::Vector2d(int frame, size_t marker, const Eigen::Vector2d&)>& shift,
    CalibrationInput* input) {
  for (int i = 0; i < world.FrameCount(c); ++i) {
    Observation& row = input->tracks[static_cast<size_t>(c)].observations[static_cast<size_t>(i)];
    for (size_t m = 0; m < row.markers.size(); ++m) {
      if (row.markers[m].visible) row.markers[m].centre_px += shift(i, m, row.markers[m].centre_px);
    }
  }
}

void MoveCamera(const SimulatedWorld& world, int c, double from_s, const Eigen::Vector3d& shift_m,
                double turn_rad, CalibrationInput* input) {
  const RigidTransform before = world.cameras()[static_cast<size_t>(c)].cam_from_rig;
  const RigidTransform step(
      Eigen::Quaterniond(Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitY())), shift_m);
  ShiftCentres(
      world, c,
      [&](int frame, size_t m, const Eigen::Vector2d&) -> Eigen::Vector2d {
        const double time_s = world.FrameRigTime(c, frame);
        if (time_s < from_s) return Eigen::Vector2d::Zero();
        return Projections(world, c, time_s, step * before)[m] -
               Projections(world, c, time_s, before)[m];
      },
      input);
}

TEST(Findings, NoneOnCleanRecordings) {
  for (int seed = 1; seed <= 20; ++seed) {
    const SimulatedWorld world =
        World(absl::StrCat("cameras=", 3 + seed % 4, ";duration=30;seed=", seed));
    CalibrationOptions options;
    if (seed % 2 == 0) options.intrinsics = Estimate::kFixed;
    if (seed % 3 == 0) options.time_offsets = Estimate::kFixed;
    if (seed % 5 == 0) options.marker_positions = Estimate::kFixed;
    if (seed % 7 == 0) options.intrinsics = Estimate::kRefined;
    const CalibrationResult result = Solve(InputOf(world), options);
    // Where intrinsics are refined, an edge that the wand never came near is a fact.
    Strings alarms = Alarms(result);
    std::erase_if(alarms, [](const std::string& alarm) { return alarm.starts_with("edge_"); });
    EXPECT_EQ(alarms, Strings()) << "seed " << seed;
    EXPECT_NE(result.quality.grade, QualityGrade::kBad) << "seed " << seed;
  }
}

TEST(Findings, ClockOffsetThatWasEstimated) {
  const SimulatedWorld world = World("cameras=5;duration=30;seed=2;offset.2=0.008");
  const CalibrationResult result = Solve(InputOf(world), Fixed());
  EXPECT_EQ(Alarms(result), Strings{"clock_offset:sim_2"});
  const Finding finding = Get(result, FindingKind::kClockOffset);
  EXPECT_NEAR(finding.value, 8, 0.2);
  EXPECT_EQ(finding.unit, "ms");
  EXPECT_THAT(finding.advice, HasSubstr("later than their stamps say"));
  EXPECT_EQ(result.quality.grade, QualityGrade::kGood);
}

TEST(Findings, ClockOffsetThatWasKeptAsGiven) {
  const SimulatedWorld world = World("cameras=5;duration=30;seed=3;offset.1=-0.012");
  CalibrationOptions options = Fixed();
  options.time_offsets = Estimate::kFixed;
  const CalibrationResult result = Solve(InputOf(world), options);
  EXPECT_EQ(Alarms(result), Strings{"clock_offset:sim_1"});
  // Along the image velocity: the wand's acceleration is left out.
  EXPECT_NEAR(Get(result, FindingKind::kClockOffset).value, -12, 0.5);
  EXPECT_NE(result.quality.grade, QualityGrade::kGood);
}

TEST(Findings, WrongIntrinsics) {
  const SimulatedWorld world = World("cameras=5;duration=30;seed=4");
  CalibrationInput input = InputOf(world);
  input.tracks[3].camera.intrinsics->fx_px *= 1.05;
  input.tracks[3].camera.intrinsics->fy_px *= 1.05;
  const CalibrationResult result = Solve(input, Fixed());
  EXPECT_EQ(Alarms(result), Strings{"wrong_intrinsics:sim_3"});
  // 1 / 1.05 is 4.8 % less.
  EXPECT_THAT(Get(result, FindingKind::kWrongIntrinsics).advice, HasSubstr("focal lengths -4."));
}

TEST(Findings, IntrinsicsFarOffMakeABadCalibration) {
  const SimulatedWorld world = World("cameras=5;duration=30;seed=5");
  CalibrationInput input = InputOf(world);
  input.tracks[1].camera.intrinsics->fx_px *= 1.15;
  input.tracks[1].camera.intrinsics->fy_px *= 1.15;
  const CalibrationResult result = Solve(input, Fixed());
  EXPECT_EQ(Alarms(result), Strings{"wrong_intrinsics:sim_1"});
  EXPECT_EQ(result.quality.grade, QualityGrade::kBad);
}

TEST(Findings, CameraThatMovedALittle) {
  const SimulatedWorld world = World("cameras=5;duration=40;seed=6");
  CalibrationInput input = InputOf(world);
  MoveCamera(world, 2, 24, {0, 0, 0}, 0.002, &input);
  const CalibrationResult result = Solve(input, Fixed());
  EXPECT_EQ(Alarms(result), Strings{"camera_moved:sim_2"});
  const Finding finding = Get(result, FindingKind::kCameraMoved);
  EXPECT_THAT(finding.advice, HasSubstr("it moved 2"));  // 20 to 29 s
  EXPECT_THAT(finding.advice, HasSubstr("0.11"));        // 0.002 rad are 0.115 deg
  EXPECT_EQ(result.quality.grade, QualityGrade::kBad);
}

TEST(Findings, CameraThatMovedFar) {
  for (const int camera : {0, 3}) {  // the reference camera, and another one
    const SimulatedWorld world = World("cameras=5;duration=40;seed=7");
    CalibrationInput input = InputOf(world);
    MoveCamera(world, camera, 25, {0.04, 0.03, 0}, 0.01, &input);
    const CalibrationResult result = Solve(input, Fixed());
    EXPECT_EQ(Alarms(result), Strings{absl::StrCat("camera_moved:sim_", camera)});
    EXPECT_EQ(result.quality.grade, QualityGrade::kBad);
  }
}

TEST(Findings, SwappedMarkers) {
  const SimulatedWorld world = World("cameras=5;duration=30;seed=8");
  CalibrationInput input = InputOf(world);
  int flipped = 0, views = 0;
  for (Observation& row : input.tracks[4].observations) {
    if (row.VisibleCount() < 2 || ++views % 20 != 0) continue;
    std::reverse(row.markers.begin(), row.markers.end());
    ++flipped;
  }
  const CalibrationResult result = Solve(input, Fixed());
  EXPECT_EQ(Alarms(result), Strings{"flipped_labels:sim_4"});
  EXPECT_NEAR(Get(result, FindingKind::kFlippedLabels).value, 5, 1);
}

TEST(Findings, WrongWandLength) {
  const SimulatedWorld world = World("cameras=5;duration=30;seed=9;length_error=0.02");
  for (const Estimate estimate : {Estimate::kRefined, Estimate::kFixed}) {
    CalibrationOptions options = Fixed();
    options.marker_positions = estimate;
    const CalibrationResult result = Solve(InputOf(world), options);
    EXPECT_EQ(Alarms(result), Strings{"wrong_wand_length:"});
    // 150 and 280 mm instead of 130 and 260: by its ratio to the second, the first span is
    // 260 * 150 / 280 = 139.3 mm.
    EXPECT_NEAR(Get(result, FindingKind::kWrongWandLength).value, 9.3, 0.3);
  }
}

TEST(Findings, RollingShutter) {
  const SimulatedWorld world = World("cameras=5;duration=30;seed=10");
  CalibrationInput input = InputOf(world);
  constexpr double kLineTimeS = 10e-6;
  const RigidTransform pose = world.cameras()[2].cam_from_rig;
  ShiftCentres(
      world, 2,
      [&](int frame, size_t m, const Eigen::Vector2d& centre) -> Eigen::Vector2d {
        const double time_s = world.FrameRigTime(2, frame);
        return Projections(world, 2, time_s + kLineTimeS * centre.y(), pose)[m] -
               Projections(world, 2, time_s, pose)[m];
      },
      &input);
  const CalibrationResult result = Solve(input, Fixed());
  Strings alarms = Alarms(result);
  // Half the image's height later in the middle: a clock offset, too, as far as the others can
  // tell.
  alarms.erase("clock_offset:sim_2");
  EXPECT_EQ(alarms, Strings{"rolling_shutter:sim_2"});
  EXPECT_NEAR(Get(result, FindingKind::kRollingShutter).value, 10, 1);
  EXPECT_EQ(Get(result, FindingKind::kRollingShutter).unit, "us");
}

TEST(Findings, EdgeThatWasNotCovered) {
  const SimulatedWorld world = World("cameras=5;duration=30;seed=11");
  CalibrationInput input = InputOf(world);
  const double limit_px = 0.5 * input.tracks[1].camera.image_size_px.width;
  for (Observation& row : input.tracks[1].observations) {
    for (MarkerObservation& marker : row.markers) {
      if (marker.centre_px.x() > limit_px) marker = {};
    }
  }
  CalibrationOptions options;
  options.intrinsics = Estimate::kRefined;
  const CalibrationResult result = Solve(input, options);
  EXPECT_EQ(Alarms(result).count("edge_coverage:sim_1"), 1u);
  for (const Finding& finding : result.findings) {
    if (finding.kind != FindingKind::kEdgeCoverage || finding.camera != "sim_1") continue;
    EXPECT_THAT(finding.advice, HasSubstr("right"));
    EXPECT_GE(finding.value, 50);
  }
  // Given intrinsics hold at the edge, too.
  EXPECT_EQ(Alarms(Solve(input, Fixed())), Strings());
}

TEST(Findings, CameraThatHangsOnFewInstants) {
  const SimulatedWorld world = World("cameras=5;duration=30;seed=12");
  CalibrationInput input = InputOf(world);
  int left = 30;
  for (size_t i = 0; i < input.tracks[4].observations.size(); ++i) {
    Observation& row = input.tracks[4].observations[i];
    if (row.VisibleCount() == 3 && i % 20 == 0 && left-- > 0) continue;
    for (MarkerObservation& marker : row.markers) marker = {};
  }
  const CalibrationResult result = Solve(input, Fixed());
  EXPECT_EQ(Alarms(result), Strings{"weak_link:sim_4"});
  EXPECT_LE(Get(result, FindingKind::kWeakLink).value, 30);
  EXPECT_EQ(result.quality.grade, QualityGrade::kUsable);
}

void EraseRows(double from_s, double to_s, CameraTrack* track) {
  const int64_t first_ns = track->observations.front().time_ns;
  std::erase_if(track->observations, [&](const Observation& row) {
    const double time_s = 1e-9 * static_cast<double>(row.time_ns - first_ns);
    return time_s >= from_s && time_s < to_s;
  });
}

TEST(Findings, CameraThatIsAwayForAPartOfTheRecording) {
  const SimulatedWorld world = World("cameras=5;duration=30;seed=2");
  CalibrationInput input = InputOf(world);
  for (CameraTrack& track : input.tracks) {
    for (size_t i = 200; i < 210; ++i) {
      for (MarkerObservation& marker : track.observations[i].markers) marker = {};
    }
  }
  EraseRows(12, 40, &input.tracks[1]);  // a file that was cut off
  EraseRows(0, 6, &input.tracks[2]);
  EraseRows(10, 16, &input.tracks[2]);
  EraseRows(10, 13, &input.tracks[3]);  // for a moment
  // Without rows where the wand is not seen nobody can tell.
  std::erase_if(input.tracks[4].observations,
                [](const Observation& row) { return row.VisibleCount() == 0; });
  EraseRows(10, 20, &input.tracks[4]);
  const CalibrationResult result = Solve(input, Fixed());
  Strings absent = Alarms(result);
  std::erase_if(absent, [](const std::string& one) { return !one.starts_with("camera_absent"); });
  EXPECT_EQ(absent, (Strings{"camera_absent:sim_1", "camera_absent:sim_2"}));
  for (const Finding& finding : result.findings) {
    if (finding.kind != FindingKind::kCameraAbsent) continue;
    EXPECT_NEAR(finding.value, finding.camera == "sim_1" ? 18 : 12, 0.5) << finding.advice;
    EXPECT_EQ(finding.severity, FindingSeverity::kInfo);
  }
}

TEST(Findings, TheRealRecordingNamesTheCameraWhoseClockIsOff) {
  RIGCAL_REQUIRE_RECORDED_DATA(folder);
  ASSERT_OK_AND_ASSIGN(const CalibrationInput input, RecordedInput(folder));
  const CalibrationResult result = Solve(input, {});
  // Its wand is bent, as either half of its cameras sees without the other.
  EXPECT_EQ(Alarms(result), (Strings{"clock_offset:frame_0", "wand_not_rigid:"}));
  EXPECT_NEAR(Get(result, FindingKind::kClockOffset).value, -8.1, 0.5);
  EXPECT_NEAR(Get(result, FindingKind::kWandNotRigid).value, 1.5, 0.3);
  EXPECT_EQ(Get(result, FindingKind::kWandNotRigid).severity, FindingSeverity::kInfo);
  EXPECT_NE(result.quality.grade, QualityGrade::kBad);

  CalibrationOptions kept;
  kept.time_offsets = Estimate::kFixed;
  const CalibrationResult as_given = Solve(input, kept);
  for (const Finding& finding : as_given.findings) {
    if (finding.kind != FindingKind::kClockOffset) continue;
    EXPECT_EQ(finding.camera, "frame_0");
    EXPECT_NEAR(finding.value, -8.1, 0.5);
  }
  EXPECT_EQ(Get(as_given, FindingKind::kClockOffset).camera, "frame_0");
}

}  // namespace
}  // namespace rigcal::server::findings_test
