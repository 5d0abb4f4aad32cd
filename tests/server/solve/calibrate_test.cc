// SPDX-License-Identifier: Apache-2.0
#include "server/solve/calibrate.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "common/camera/camera_model.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::calibrate_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kDegree = M_PI / 180;

SimulatedWorld World(const std::string& options) {
  const auto parsed = ParseSimulationOptions(options);
  EXPECT_THAT(parsed, IsOk());
  auto world = SimulatedWorld::Create(*parsed, WandTarget());
  EXPECT_THAT(world, IsOk());
  return *std::move(world);
}

void ExpectSameBits(const CalibrationResult& a, const CalibrationResult& b) {
  EXPECT_EQ(a.observation_digest, b.observation_digest);
  EXPECT_EQ(a.instant_count, b.instant_count);
  EXPECT_EQ(a.iteration_count, b.iteration_count);
  EXPECT_EQ(a.refused, b.refused);
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    EXPECT_EQ(a.cameras[c].cam_from_rig.Matrix(), b.cameras[c].cam_from_rig.Matrix());
    EXPECT_EQ(a.cameras[c].time_offset_s, b.cameras[c].time_offset_s);
    EXPECT_EQ(a.cameras[c].residuals.all.mean_px, b.cameras[c].residuals.all.mean_px);
    EXPECT_EQ(a.cameras[c].intrinsics, b.cameras[c].intrinsics);
  }
  EXPECT_EQ(a.target.length_error_rms_m, b.target.length_error_rms_m);
}

class ManyCameras : public ::testing::TestWithParam<std::string> {};

// 2 mm and 0.05 degrees are what the issue of the first solver asks; noise of 0.3 px leaves a tenth
// of it.
TEST_P(ManyCameras, AreWithinTwoMillimetresOfTheGroundTruth) {
  const SimulatedWorld world = World(GetParam());
  const CalibrationOutcome outcome = Calibrate(InputOf(world), {});
  ASSERT_THAT(outcome.result, IsOk());
  const PoseErrors errors = ComparePoses(*outcome.result, world);
  EXPECT_LT(errors.worst_position_m, 0.002);
  EXPECT_LT(errors.worst_rotation_rad, 0.05 * kDegree);
  EXPECT_TRUE(outcome.result->scale_known);
  EXPECT_EQ(outcome.result->reference_camera, "sim_0");
  EXPECT_TRUE(outcome.result->cameras[0].cam_from_rig.translation_m.isZero());
}

INSTANTIATE_TEST_SUITE_P(Simulated, ManyCameras,
                         ::testing::Values("seed=1", "seed=2", "seed=3", "cameras=2", "cameras=3",
                                           "cameras=24;duration=20", "outliers=0.1",
                                           "outliers=0.02;dropouts=0.3;swaps=0.05"));

TEST(Calibrate, CountsTheOutliersThatWereThere) {
  const SimulatedWorld world = World("outliers=0.1;duration=30");
  std::vector<std::vector<std::vector<bool>>> truth;
  const CalibrationInput input = InputOf(world, &truth);
  uint32_t expected = 0;
  for (const auto& camera : truth) {
    for (const auto& frame : camera) {
      for (const bool is_outlier : frame) expected += is_outlier ? 1 : 0;
    }
  }
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  uint32_t found = 0;
  for (const CalibratedCamera& camera : outcome.result->cameras) {
    found += camera.residuals.outlier_count;
    EXPECT_LT(camera.residuals.inlier.mean_px, 0.45);
    EXPECT_GT(camera.residuals.all.mean_px, 5) << "outliers are part of the overall figures";
  }
  EXPECT_NEAR(found, expected, 0.05 * expected);
}

TEST(Calibrate, DoesNotDependOnTheOrderOfArrival) {
  const SimulatedWorld world = World("cameras=4;duration=10");
  const CalibrationInput input = InputOf(world);
  CalibrationInput permuted = input;
  std::mt19937 random(5);
  std::shuffle(permuted.tracks.begin(), permuted.tracks.end(), random);
  for (CameraTrack& track : permuted.tracks) {
    std::shuffle(track.observations.begin(), track.observations.end(), random);
  }
  const CalibrationOutcome a = Calibrate(input, {}), b = Calibrate(permuted, {});
  ASSERT_THAT(a.result, IsOk());
  ASSERT_THAT(b.result, IsOk());
  ExpectSameBits(*a.result, *b.result);
}

TEST(Calibrate, AnotherReferenceCameraIsTheSameRig) {
  const SimulatedWorld world = World("cameras=3;duration=20");
  CalibrationOptions options;
  options.reference_camera = "sim_2";
  const CalibrationOutcome outcome = Calibrate(InputOf(world), options);
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(outcome.result->reference_camera, "sim_2");
  EXPECT_TRUE(outcome.result->cameras[2].cam_from_rig.translation_m.isZero());
  EXPECT_LT(ComparePoses(*outcome.result, world).worst_position_m, 0.002);
}

// Keeps of each camera only the part of the wave in which it and its next neighbour see the wand,
// so that no camera sees what all others see.
CalibrationInput Chain(const SimulatedWorld& world, size_t first_link, size_t last_link) {
  CalibrationInput input = InputOf(world);
  const size_t count = input.tracks.size();
  for (size_t c = 0; c < count; ++c) {
    std::vector<Observation>& rows = input.tracks[c].observations;
    const size_t slot = rows.size() / (count - 1);
    for (size_t i = 0; i < rows.size(); ++i) {
      const size_t link = std::min(i / slot, count - 2);  // of cameras link and link + 1
      if (link >= first_link && link <= last_link && (c == link || c == link + 1)) continue;
      for (MarkerObservation& marker : rows[i].markers) marker.visible = false;
    }
  }
  return input;
}

TEST(Calibrate, SolvesAChainInWhichNoCameraSeesWhatAllOthersSee) {
  const SimulatedWorld world = World("cameras=5;duration=100");
  const CalibrationOutcome outcome = Calibrate(Chain(world, 0, 3), {});
  ASSERT_THAT(outcome.result, IsOk());
  // Four pairs in a row with a quarter of the views each: errors add up along the chain.
  EXPECT_LT(ComparePoses(*outcome.result, world).worst_position_m, 0.008);
}

TEST(Calibrate, NamesTheGroupsThatAreNotConnected) {
  const SimulatedWorld world = World("cameras=4;duration=40");
  CalibrationInput input = Chain(world, 0, 2);
  // The link between sim_1 and sim_2 is cut.
  for (CameraTrack& track : input.tracks) {
    const size_t slot = track.observations.size() / 3;
    for (size_t i = slot; i < 2 * slot; ++i) {
      for (MarkerObservation& marker : track.observations[i].markers) marker.visible = false;
    }
  }
  const CalibrationOutcome outcome = Calibrate(input, {});
  EXPECT_THAT(outcome.result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("not connected"), HasSubstr("2 groups"), HasSubstr("sim_0"),
                             HasSubstr("sim_3"), HasSubstr("would best join them"),
                             HasSubstr("wave the wand"))));
}

TEST(Calibrate, NamesACameraThatNeverSawTheWand) {
  const SimulatedWorld world = World("cameras=3;duration=5");
  CalibrationInput input = InputOf(world);
  for (Observation& row : input.tracks[1].observations) row.markers.clear();
  EXPECT_THAT(Calibrate(input, {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("sim_1"), HasSubstr("never saw the wand"),
                             HasSubstr("125 observations"))));
}

TEST(Calibrate, NamesACameraWithoutIntrinsics) {
  CalibrationInput input = InputOf(World("cameras=3;duration=5"));
  input.tracks[2].camera.intrinsics.reset();
  EXPECT_THAT(Calibrate(input, {}).result,
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("sim_2"), HasSubstr("intrinsics"))));
}

TEST(Calibrate, RefusesWhatCannotBeSolved) {
  const CalibrationInput good = InputOf(World("cameras=3;duration=5"));
  EXPECT_THAT(Calibrate({}, {}).result,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("marker positions")));
  CalibrationInput input = good;
  input.tracks.resize(1);
  EXPECT_THAT(Calibrate(input, {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("two cameras")));
  CalibrationOptions options;
  options.reference_camera = "nobody";
  EXPECT_THAT(Calibrate(good, options).result,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("nobody")));
}

TEST(Calibrate, SaysWhenTheWandStoodStill) {
  CalibrationInput input = InputOf(World("cameras=3;duration=20;outliers=0;dropouts=0"));
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.3);
  for (CameraTrack& track : input.tracks) {
    const auto seen = std::find_if(track.observations.begin(), track.observations.end(),
                                   [](const Observation& row) { return row.VisibleCount() == 3; });
    ASSERT_NE(seen, track.observations.end());
    const auto markers = seen->markers;
    for (Observation& row : track.observations) {
      row.markers = markers;
      for (MarkerObservation& marker : row.markers) {
        marker.centre_px += Eigen::Vector2d(noise(random), noise(random));
      }
    }
  }
  EXPECT_THAT(Calibrate(input, {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("wand")));
}

TEST(Calibrate, ValuesThatAreNotFiniteAreCountedNotSpread) {
  const SimulatedWorld world = World("cameras=3;duration=20");
  CalibrationInput input = InputOf(world);
  for (size_t i = 0; i < input.tracks[0].observations.size(); i += 10) {
    Observation& row = input.tracks[0].observations[i];
    for (MarkerObservation& marker : row.markers) {
      if (marker.visible) marker.centre_px.x() = std::numeric_limits<double>::quiet_NaN();
    }
  }
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_LT(ComparePoses(*outcome.result, world).worst_position_m, 0.002);
  EXPECT_TRUE(std::any_of(outcome.refused.begin(), outcome.refused.end(), [](const Refusal& entry) {
    return entry.reason == RefusalReason::kValueNotFinite && entry.camera == "sim_0" &&
           entry.count > 20;
  }));
}

TEST(Calibrate, StopsWhenCancelled) {
  const CalibrationInput input = InputOf(World("cameras=4;duration=20"));
  std::atomic<bool> cancelled = false;
  CalibrationHooks hooks;
  hooks.cancelled = &cancelled;
  int calls = 0;
  hooks.progress = [&](CalibrationStage stage, double fraction) {
    EXPECT_NE(stage, CalibrationStage::kUnspecified);
    EXPECT_GE(fraction, 0);
    EXPECT_LE(fraction, 1);
    if (++calls == 8) cancelled = true;
  };
  EXPECT_THAT(Calibrate(input, {}, hooks).result,
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("cancelled")));
}

TEST(Calibrate, TwoSessionsOfOneRigAreOneSolve) {
  const SimulatedWorld first = World("cameras=3;duration=15"),
                       second = World("cameras=3;duration=15;seed=1;noise=0.31");
  CalibrationInput input = InputOf(first);
  for (CameraTrack& track : InputOf(second).tracks) {
    track.session_id = "t";
    input.tracks.push_back(track);
  }
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(outcome.result->cameras.size(), 3u);
  EXPECT_GT(outcome.result->instant_count, 500u);
  EXPECT_LT(ComparePoses(*outcome.result, first).worst_position_m, 0.002);
}

// The two halves of a wave as sessions; in the second one every clock was started anew, each at
// another moment, and one camera's rows are turned about its centre.
CalibrationInput TwoHalves(const SimulatedWorld& world, const std::string& turned,
                           double angle_rad) {
  const double half_s = 0.5 * world.options().duration_s;
  const Eigen::AngleAxisd turn(angle_rad, Eigen::Vector3d(1, 1, 0.3).normalized());
  CalibrationInput input = InputOf(world), halves = InputOf(world);
  halves.tracks.clear();
  for (size_t c = 0; c < input.tracks.size(); ++c) {
    CameraTrack first = input.tracks[c], second = input.tracks[c];
    first.session_id = "monday";
    second.session_id = "friday";  // earlier by name
    first.observations.clear();
    second.observations.clear();
    for (size_t i = 0; i < input.tracks[c].observations.size(); ++i) {
      Observation row = input.tracks[c].observations[i];
      if (world.FrameRigTime(static_cast<int>(c), static_cast<int>(i)) < half_s) {
        first.observations.push_back(row);
        continue;
      }
      row.time_ns += std::llround(1e9 * (0.07 * static_cast<double>(c) - half_s));
      for (MarkerObservation& marker : row.markers) {
        if (!marker.visible || second.camera.camera != turned) continue;
        const auto ray = Undistort(*second.camera.intrinsics, marker.centre_px);
        Eigen::Vector2d pixel;
        if (ray.ok() && Project(*second.camera.intrinsics, turn * ray->homogeneous(), &pixel)) {
          marker.centre_px = pixel;
        }
      }
      second.observations.push_back(row);
    }
    halves.tracks.push_back(std::move(first));
    halves.tracks.push_back(std::move(second));
  }
  return halves;
}

std::vector<Finding> MovesOf(const CalibrationResult& result) {
  std::vector<Finding> moves;
  for (const Finding& finding : result.findings) {
    if (finding.kind == FindingKind::kCameraMoved) moves.push_back(finding);
  }
  return moves;
}

TEST(Calibrate, ClocksThatWereStartedAnewBetweenSessionsHaveOffsetsOfTheirOwn) {
  const SimulatedWorld world = World("cameras=4;duration=30");
  const CalibrationOutcome outcome = Calibrate(TwoHalves(world, "", 0), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_LT(ComparePoses(*outcome.result, world).worst_position_m, 0.002);
  EXPECT_TRUE(MovesOf(*outcome.result).empty());
  EXPECT_NE(outcome.result->quality.grade, QualityGrade::kBad);
  for (const CalibratedCamera& camera : outcome.result->cameras) {
    EXPECT_LT(camera.residuals.inlier.mean_px, 0.45) << camera.camera;
  }
}

TEST(Calibrate, ACameraThatMovedBetweenSessionsIsNamed) {
  const SimulatedWorld world = World("cameras=4;duration=30");
  const CalibrationOutcome outcome = Calibrate(TwoHalves(world, "sim_2", 0.1 * M_PI / 180), {});
  ASSERT_THAT(outcome.result, IsOk());
  const std::vector<Finding> moves = MovesOf(*outcome.result);
  ASSERT_EQ(moves.size(), 1u);
  EXPECT_EQ(moves[0].camera, "sim_2");
  EXPECT_THAT(moves[0].advice, HasSubstr("it moved between session"));
  EXPECT_NEAR(moves[0].value, 2.2, 0.7);  // pixels
}

TEST(Calibrate, ClocksWithOriginsOfTheirOwnAreAlignedBySamples) {
  const SimulatedWorld world = World("cameras=3;duration=20;clock_samples=1");
  const CalibrationOutcome outcome = Calibrate(InputOf(world), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_LT(ComparePoses(*outcome.result, world).worst_position_m, 0.002);
}

TEST(Calibrate, FreelyRunningCamerasAreInterpolated) {
  const SimulatedWorld world = World(
      "free_running=1;jitter=0.00002;wand_speed=2;duration=30;rate.0=50;rate.1=60;rate.2=120;rate."
      "3=50;"
      "rate.4=60;rate.5=120;offset.1=0.5;offset.2=-0.3;offset.5=0.01");
  const CalibrationOutcome outcome = Calibrate(InputOf(world), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_LT(ComparePoses(*outcome.result, world).worst_position_m, 0.002);
  const double zero_s = outcome.result->cameras[0].time_offset_s;
  for (size_t c = 1; c < 6; ++c) {
    const CalibratedCamera& camera = outcome.result->cameras[c];
    const auto truth = world.options().time_offset_s.find(static_cast<int>(c));
    EXPECT_NEAR(camera.time_offset_s - zero_s,
                truth == world.options().time_offset_s.end() ? 0 : truth->second, 1e-4)
        << camera.camera;
    EXPECT_LT(camera.residuals.inlier.mean_px, 0.45);
  }
}

TEST(Calibrate, CarriesOverWhatOthersRefused) {
  CalibrationInput input = InputOf(World("cameras=2;duration=20"));
  input.refused.push_back({"sim_1", RefusalReason::kCsvNotANumber, 3, "line 4"});
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(std::count(outcome.result->refused.begin(), outcome.result->refused.end(),
                       input.refused.front()),
            1);
}

}  // namespace
}  // namespace rigcal::server::calibrate_test
