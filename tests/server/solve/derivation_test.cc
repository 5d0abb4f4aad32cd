// SPDX-License-Identifier: Apache-2.0
// Kinds of solve: repaired, joined and refined rigs, held intrinsics, what-ifs.
#include "server/solve/derivation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "server/solve/evaluate/rig_difference.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::derivation_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

constexpr double kRateHz = 20;

SimulatedWorld World() {
  SimulationOptions options;
  options.camera_count = 4;
  options.duration_s = 45;
  options.rate_hz = kRateHz;
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  return *SimulatedWorld::Create(options, target);
}

// Frames of a time, without some cameras.
CalibrationInput Part(const SimulatedWorld& world, double from_s, double to_s,
                      const std::string& without = "") {
  CalibrationInput input = InputOf(world);
  std::erase_if(input.tracks,
                [&](const CameraTrack& track) { return track.camera.camera == without; });
  for (CameraTrack& track : input.tracks) {
    const auto begin = track.observations.begin();
    track.observations = {begin + static_cast<std::ptrdiff_t>(from_s * kRateHz),
                          begin + static_cast<std::ptrdiff_t>(to_s * kRateHz)};
  }
  return input;
}

CalibrationResult Solve(const CalibrationInput& input, const CalibrationOptions& options = {}) {
  const CalibrationOutcome outcome = Calibrate(input, options);
  EXPECT_THAT(outcome.result, IsOk());
  return outcome.result.ok() ? *outcome.result : CalibrationResult();
}

CalibrationOptions DerivedOptions(SolveKind kind, std::vector<std::string> only = {}) {
  CalibrationOptions options;
  options.kind = kind;
  options.parent_id = "c-000001";
  options.only_cameras = std::move(only);
  return options;
}

TEST(Derivation, ACameraJoinsTheRig) {
  const SimulatedWorld world = World();
  const CalibrationResult parent = Solve(Part(world, 0, 20, "sim_0"));
  ASSERT_EQ(parent.cameras.size(), 3u);
  CalibrationInput input = Part(world, 20, 32);
  input.parent = parent;
  const CalibrationResult joined = Solve(input, DerivedOptions(SolveKind::kRepair, {"sim_0"}));
  ASSERT_EQ(joined.cameras.size(), 4u);
  EXPECT_EQ(joined.reference_camera, parent.reference_camera);
  for (const CalibratedCamera& camera : parent.cameras) {
    const auto same = std::ranges::find(joined.cameras, camera.camera, &CalibratedCamera::camera);
    EXPECT_EQ(same->cam_from_rig.translation_m, camera.cam_from_rig.translation_m);
    // With its uncertainty.
    EXPECT_NEAR(same->uncertainty->position_sigma_m.norm(),
                camera.uncertainty->position_sigma_m.norm(),
                1e-6 + 1e-3 * camera.uncertainty->position_sigma_m.norm());
  }
  EXPECT_LT(ComparePoses(joined, world).worst_position_m, 0.004);
  EXPECT_GT(joined.cameras[0].uncertainty->position_sigma_m.norm(), 0);
}

// As uncertain as a solve of both parts, and no more different from it than that.
TEST(Derivation, ARefinementIsAsGoodAsASolveOfBothParts) {
  const SimulatedWorld world = World();
  const CalibrationResult parent = Solve(Part(world, 0, 20));
  CalibrationInput input = Part(world, 20, 40);
  const CalibrationResult alone = Solve(input);
  const CalibrationResult both = Solve(Part(world, 0, 40));
  input.parent = parent;
  const CalibrationResult refined = Solve(input, DerivedOptions(SolveKind::kRefine));
  for (size_t c = 1; c < refined.cameras.size(); ++c) {
    const double sigma_m = refined.cameras[c].uncertainty->position_sigma_m.norm();
    const double both_m = both.cameras[c].uncertainty->position_sigma_m.norm();
    EXPECT_LT(sigma_m, 0.9 * alone.cameras[c].uncertainty->position_sigma_m.norm());
    EXPECT_LT(sigma_m, 0.9 * parent.cameras[c].uncertainty->position_sigma_m.norm());
    EXPECT_NEAR(sigma_m / both_m, 1, 0.3);
    EXPECT_LT((refined.cameras[c].cam_from_rig.SourceFromTargetTranslation() -
               both.cameras[c].cam_from_rig.SourceFromTargetTranslation())
                  .norm(),
              2 * both_m);
  }
}

// Lenses that the parent has refined go on with its covariance: as good as a solve of both parts,
// where kept ones would hold what the first part got wrong.
TEST(Derivation, ARefinementGoesOnWithRefinedLenses) {
  const SimulatedWorld world = World();
  CalibrationOptions with_lenses;
  with_lenses.intrinsics = Estimate::kRefined;
  with_lenses.fixed_intrinsics = {"sim_1"};
  const CalibrationResult parent = Solve(Part(world, 0, 20), with_lenses);
  const CalibrationResult both = Solve(Part(world, 0, 40), with_lenses);
  CalibrationInput input = Part(world, 20, 40);
  input.parent = parent;
  const CalibrationResult refined = Solve(input, DerivedOptions(SolveKind::kRefine));
  for (size_t c = 0; c < refined.cameras.size(); ++c) {
    const CalibratedCamera &camera = refined.cameras[c], &before = parent.cameras[c];
    EXPECT_EQ(camera.intrinsics_refined, camera.camera != "sim_1");
    if (!camera.intrinsics_refined) {
      EXPECT_EQ(camera.intrinsics, before.intrinsics);
      continue;
    }
    const double sigma_px = camera.uncertainty->intrinsics_sigma[0];
    EXPECT_LT(sigma_px, 0.95 * before.uncertainty->intrinsics_sigma[0]);
    EXPECT_NEAR(sigma_px / both.cameras[c].uncertainty->intrinsics_sigma[0], 1, 0.35);
    EXPECT_LT(std::abs(camera.intrinsics.fx_px - both.cameras[c].intrinsics.fx_px), 2 * sigma_px);
  }
  EXPECT_EQ(refined.camera_covariance.size(), both.camera_covariance.size());
}

TEST(Derivation, KeptIntrinsicsStayWhileOthersAreRefined) {
  const SimulatedWorld world = World();
  CalibrationOptions options;
  options.intrinsics = Estimate::kRefined;
  options.fixed_intrinsics = {"sim_1"};
  const CalibrationInput input = Part(world, 0, 30);
  const CalibrationResult result = Solve(input, options);
  for (size_t c = 0; c < result.cameras.size(); ++c) {
    const bool kept = result.cameras[c].camera == "sim_1";
    EXPECT_EQ(result.cameras[c].intrinsics_refined, !kept) << result.cameras[c].camera;
    EXPECT_EQ(result.cameras[c].intrinsics == *input.tracks[c].camera.intrinsics, kept);
  }
}

TEST(Derivation, AWhatIfLeavesOutWhatItSays) {
  CalibrationInput input = Part(World(), 0, 10);
  CalibrationOptions options;
  options.what_if = true;
  options.without_cameras = {"sim_2"};
  options.from_s = 2;
  options.to_s = 5;
  options.assumed_target = input.target;
  options.assumed_target->marker_positions_m[1] = 0.1301;
  ASSERT_THAT(ApplyDerivation(options, &input), IsOk());
  ASSERT_EQ(input.tracks.size(), 3u);
  for (const CameraTrack& track : input.tracks) {
    EXPECT_NE(track.camera.camera, "sim_2");
    EXPECT_EQ(track.observations.size(), 60u);
  }
  EXPECT_EQ(input.target.marker_positions_m[1], 0.1301);
}

TEST(Derivation, RefusesWhatDoesNotFit) {
  const CalibrationInput input = Part(World(), 0, 4);
  const auto refusal = [&](const CalibrationOptions& options) {
    CalibrationInput changed = input;
    return ApplyDerivation(options, &changed);
  };
  CalibrationOptions options;
  options.what_if = true;
  options.without_cameras = {"sim_9"};
  EXPECT_THAT(refusal(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("camera 'sim_9'")));
  options = {};
  options.what_if = true;
  options.assumed_target = input.target;
  options.assumed_target->marker_positions_m.push_back(0.5);
  EXPECT_THAT(refusal(options),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("has 4 markers")));
  options = {};
  ImageSize size = input.tracks[1].camera.image_size_px;
  size.width /= 2;
  options.given_intrinsics = {{"sim_1", size, *input.tracks[1].camera.intrinsics}};
  EXPECT_THAT(refusal(options),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("camera sim_1")));
  EXPECT_THAT(refusal(DerivedOptions(SolveKind::kRefine)),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("c-000001")));
}

}  // namespace
}  // namespace rigcal::server::derivation_test
