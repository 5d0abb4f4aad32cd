// SPDX-License-Identifier: Apache-2.0
// Kinds of solve: repaired, joined and refined rigs, held intrinsics, what-ifs.
#include "server/solve/derivation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "common/camera/camera_model.h"
#include "common/camera/fit_intrinsics.h"
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

// A camera that stands nearer since, behind a lens of 130 degrees. Returns its pose.
RigidTransform PhotographWide(const SimulatedWorld& world, int camera, double from_s,
                              const Intrinsics& lens, CameraTrack* track) {
  RigidTransform cam_from_world = world.cameras()[static_cast<size_t>(camera)].cam_from_rig;
  const Eigen::Vector3d middle_m(0, 0, 1.5);
  const Eigen::Vector3d centre_m =
      middle_m + 0.6 * (cam_from_world.SourceFromTargetTranslation() - middle_m);
  cam_from_world.translation_m = -(cam_from_world.rotation * centre_m);
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.3);
  const ImageSize size = track->camera.image_size_px;
  for (size_t i = 0; i < track->observations.size(); ++i) {
    const int frame = static_cast<int>(from_s * kRateHz) + static_cast<int>(i);
    const WandPose wand = world.WandAt(world.FrameRigTime(camera, frame));
    for (size_t m = 0; m < track->observations[i].markers.size(); ++m) {
      MarkerObservation& marker = track->observations[i].markers[m];
      Eigen::Vector2d pixel;
      marker.visible = ImageOf(lens, cam_from_world * world.MarkerAt(wand, m), &pixel);
      pixel += Eigen::Vector2d(noise(random), noise(random));
      marker.visible = marker.visible && pixel.x() >= 0 && pixel.y() >= 0 &&
                       pixel.x() <= size.width - 1 && pixel.y() <= size.height - 1;
      if (marker.visible) marker.centre_px = pixel;
    }
  }
  return cam_from_world;
}

// What a calibration of `lens` by another model gives, by a board in most of the image.
Intrinsics DescribedBy(DistortionModel model, const Intrinsics& lens, const ImageSize& size) {
  std::vector<RayPixel> rays;
  for (uint32_t x = 0; x < size.width; x += 50) {
    for (uint32_t y = 0; y < size.height; y += 50) {
      const Eigen::Vector2d pixel(x, y);
      const Eigen::Vector2d from_centre = pixel - Eigen::Vector2d(lens.cx_px, lens.cy_px);
      if (from_centre.norm() > 0.45 * size.width) continue;
      const auto ray = Undistort(lens, pixel);
      if (ray.ok()) rays.push_back({ray->homogeneous(), pixel});
    }
  }
  const auto fit = FitIntrinsics(model, rays, lens);
  EXPECT_THAT(fit, IsOk());
  return fit.ok() ? fit->intrinsics : lens;
}

void ExpectOthersAsBefore(const CalibrationResult& parent, const CalibrationResult& repaired,
                          const std::string& solved) {
  ASSERT_EQ(repaired.cameras.size(), parent.cameras.size());
  for (size_t c = 0; c < parent.cameras.size(); ++c) {
    const CalibratedCamera &before = parent.cameras[c], &after = repaired.cameras[c];
    if (before.camera == solved) continue;
    EXPECT_EQ(after.cam_from_rig.translation_m, before.cam_from_rig.translation_m) << before.camera;
    EXPECT_EQ(after.cam_from_rig.rotation.coeffs(), before.cam_from_rig.rotation.coeffs())
        << before.camera;
    EXPECT_EQ(after.intrinsics, before.intrinsics) << before.camera;
  }
}

// Another lens model that is clearly better is chosen for the camera that is solved, and the others
// keep their poses and lenses by the bit; so they do where lenses are asked to be refined.
TEST(Derivation, ARepairThatChoosesALensLeavesTheOthersAlone) {
  const SimulatedWorld world = World();
  CalibrationResult parent = Solve(Part(world, 0, 20));
  ASSERT_EQ(parent.cameras.size(), 4u);
  CalibrationInput input = Part(world, 20, 45);
  const ImageSize size = input.tracks[2].camera.image_size_px;
  ASSERT_EQ(input.tracks[2].camera.camera, "sim_2");
  const double focal_px = 0.5 * size.width / 1.1345;
  const Intrinsics lens{
      DistortionModel::kFisheye, focal_px, focal_px, 0.5 * size.width - 4, 0.5 * size.height + 3,
      {-0.02, 0.004, 0, 0}};
  const RigidTransform cam_from_world = PhotographWide(world, 2, 20, lens, &input.tracks[2]);
  parent.cameras[2].intrinsics = DescribedBy(DistortionModel::kBrownConrady, lens, size);
  input.parent = parent;
  for (const Estimate intrinsics : {Estimate::kAuto, Estimate::kRefined}) {
    CalibrationOptions options = DerivedOptions(SolveKind::kRepair, {"sim_2"});
    options.intrinsics = intrinsics;
    const CalibrationResult repaired = Solve(input, options);
    ASSERT_EQ(repaired.cameras.size(), 4u);
    ExpectOthersAsBefore(parent, repaired, "sim_2");
    const bool chosen = intrinsics == Estimate::kAuto;
    EXPECT_EQ(repaired.cameras[2].intrinsics.model != DistortionModel::kBrownConrady, chosen);
    EXPECT_NE(repaired.cameras[2].intrinsics, parent.cameras[2].intrinsics);
    if (!chosen) continue;
    EXPECT_EQ(std::ranges::count(repaired.findings, FindingKind::kWrongLensModel, &Finding::kind),
              1);
    const Eigen::Vector3d centre_m =
        world.cameras()[0].cam_from_rig * cam_from_world.SourceFromTargetTranslation();
    EXPECT_LT((repaired.cameras[2].cam_from_rig.SourceFromTargetTranslation() - centre_m).norm(),
              0.03);
  }
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
