// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::point_target_test {
namespace {

using rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

SimulatedWorld PointWorld(std::string_view text) {
  Target target;
  target.kind = TargetKind::kPoint;
  target.marker_positions_m = {0};
  absl::StatusOr<SimulationOptions> options = ParseSimulationOptions(text);
  EXPECT_THAT(options, IsOk());
  absl::StatusOr<SimulatedWorld> world = SimulatedWorld::Create(*options, target);
  EXPECT_THAT(world, IsOk());
  return *std::move(world);
}

double DistanceM(const RigidTransform& a, const RigidTransform& b) {
  return (a.SourceFromTargetTranslation() - b.SourceFromTargetTranslation()).norm();
}

double TrueDistanceM(const SimulatedWorld& world, size_t a, size_t b) {
  return DistanceM(world.cameras()[a].cam_from_rig, world.cameras()[b].cam_from_rig);
}

const CalibratedCamera& Camera(const CalibrationResult& result, std::string_view name) {
  return *std::find_if(result.cameras.begin(), result.cameras.end(),
                       [&name](const CalibratedCamera& camera) { return camera.camera == name; });
}

// In metres, by the true length of the unit.
CalibrationResult Scaled(CalibrationResult result, const SimulatedWorld& world) {
  const auto truth = [&world](const std::string& name) {
    return std::find_if(
               world.cameras().begin(), world.cameras().end(),
               [&name](const SimulatedCamera& camera) { return camera.description.camera == name; })
        ->cam_from_rig;
  };
  const double unit_m = DistanceM(truth(result.reference_camera), truth(result.unit_camera));
  for (CalibratedCamera& camera : result.cameras) camera.cam_from_rig.translation_m *= unit_m;
  return result;
}

// Of the recording cut into blocks of equal length, a camera sees those that name it.
CalibrationInput OnlySeenBy(const SimulatedWorld& world,
                            const std::vector<std::vector<size_t>>& blocks) {
  CalibrationInput input = InputOf(world);
  for (size_t c = 0; c < input.tracks.size(); ++c) {
    std::vector<Observation>& rows = input.tracks[c].observations;
    for (size_t i = 0; i < rows.size(); ++i) {
      const std::vector<size_t>& seen_by = blocks[i * blocks.size() / rows.size()];
      if (std::find(seen_by.begin(), seen_by.end(), c) != seen_by.end()) continue;
      for (MarkerObservation& marker : rows[i].markers) marker.visible = false;
    }
  }
  return input;
}

TEST(PointTarget, IsSolvedInTheUnitOfANamedDistance) {
  const SimulatedWorld world = PointWorld("cameras=6;duration=40");
  const CalibrationOutcome outcome = Calibrate(InputOf(world), {});
  ASSERT_THAT(outcome.result, IsOk());
  const CalibrationResult& result = *outcome.result;
  EXPECT_FALSE(result.scale_known);
  ASSERT_THAT(result.unit_camera, Not(IsEmpty()));
  EXPECT_NE(result.unit_camera, result.reference_camera);
  const RigidTransform& reference = Camera(result, result.reference_camera).cam_from_rig;
  EXPECT_NEAR(DistanceM(reference, Camera(result, result.unit_camera).cam_from_rig), 1, 1e-9);
  EXPECT_EQ(result.target.scale_sigma_rel, 0);
  EXPECT_THAT(result.target.spans, IsEmpty());
  EXPECT_THAT(result.target.marker_positions_m, IsEmpty());
  EXPECT_EQ(result.target.length_error_rms_m, 0);
  // 1.5 mm of rigs whose cameras are metres apart: three times what a wand of the same recording
  // gives, as one marker is a third of the measurements and no length of its own.
  const PoseErrors errors = ComparePoses(Scaled(result, world), world);
  EXPECT_LT(errors.worst_position_m, 0.0015);
  EXPECT_LT(errors.worst_rotation_rad, 0.001);
  EXPECT_EQ(result.quality.grade, QualityGrade::kGood);
  for (const CalibratedCamera& camera : result.cameras) {
    ASSERT_TRUE(camera.held_out && camera.leave_one_out && camera.uncertainty);
    EXPECT_LT(camera.held_out->mean_px, 0.45);
    EXPECT_LT(camera.leave_one_out->mean_px, 0.6);
  }
}

TEST(PointTarget, IsMetricWithAKnownDistance) {
  const SimulatedWorld world = PointWorld("cameras=6;duration=40;seed=2");
  const double true_m = TrueDistanceM(world, 1, 4);
  CalibrationOptions options;
  options.known_distance = KnownDistance{"sim_1", "sim_4", true_m, 0.003};
  const CalibrationOutcome outcome = Calibrate(InputOf(world), options);
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_TRUE(outcome.result->scale_known);
  EXPECT_THAT(outcome.result->unit_camera, IsEmpty());
  EXPECT_NEAR(outcome.result->target.scale_sigma_rel, 0.003 / true_m, 1e-12);
  const CalibrationResult& result = *outcome.result;
  EXPECT_NEAR(DistanceM(Camera(result, "sim_1").cam_from_rig, Camera(result, "sim_4").cam_from_rig),
              true_m, 1e-9);
  EXPECT_LT(ComparePoses(result, world).worst_position_m, 0.0015);

  // A distance that is 1 % too long makes everything so, and nothing else.
  options.known_distance->distance_m *= 1.01;
  const CalibrationOutcome longer = Calibrate(InputOf(world), options);
  ASSERT_THAT(longer.result, IsOk());
  for (const CalibratedCamera& camera : longer.result->cameras) {
    const RigidTransform& before = Camera(result, camera.camera).cam_from_rig;
    EXPECT_LT((camera.cam_from_rig.translation_m - 1.01 * before.translation_m).norm(), 1e-5);
    EXPECT_LT(camera.cam_from_rig.rotation.angularDistance(before.rotation), 1e-6);
  }
  EXPECT_NE(longer.result->observation_digest, result.observation_digest);
}

TEST(PointTarget, SigmasMatchTheErrors) {
  // Each camera's centre against the ground truth in the gauge of the result; seven to eight
  // degrees of freedom a seed, of which a mean square outside these limits is a matter of 1 in 10
  // 000.
  double squares = 0;
  int count = 0;
  for (const char* seed : {"1", "2", "3", "4", "5", "6", "7", "8"}) {
    const SimulatedWorld world =
        PointWorld(absl::StrCat("cameras=4;duration=20;outliers=0;dropouts=0;seed=", seed));
    CalibrationOptions options;
    options.intrinsics = Estimate::kFixed;
    options.known_distance = KnownDistance{"sim_0", "sim_2", TrueDistanceM(world, 0, 2), 0.001};
    const CalibrationOutcome outcome = Calibrate(InputOf(world), options);
    ASSERT_THAT(outcome.result, IsOk());
    const RigidTransform& reference = world.cameras()[0].cam_from_rig;
    for (size_t c = 1; c < 4; ++c) {
      const CalibratedCamera& camera = outcome.result->cameras[c];
      ASSERT_TRUE(camera.uncertainty);
      const RigidTransform truth = world.cameras()[c].cam_from_rig * reference.Inverse();
      const Eigen::Vector3d error =
          camera.cam_from_rig.SourceFromTargetTranslation() - truth.SourceFromTargetTranslation();
      for (int i = 0; i < 3; ++i) {
        const double sigma_m = camera.uncertainty->position_sigma_m[i];
        // The known distance is along this camera's baseline, which it may hold nearly entirely.
        if (sigma_m < 1e-6) continue;
        squares += error[i] * error[i] / (sigma_m * sigma_m);
        ++count;
      }
    }
  }
  EXPECT_GT(squares / count, 0.5);
  EXPECT_LT(squares / count, 1.7);
}

TEST(PointTarget, OffsetsOfEverySizeAreFound) {
  const SimulatedWorld world = PointWorld("cameras=5;duration=40;offset.1=0.4;offset.3=-0.008");
  const CalibrationOutcome outcome = Calibrate(InputOf(world), {});
  ASSERT_THAT(outcome.result, IsOk());
  for (const auto& [name, offset_s] : {std::pair("sim_1", 0.4), std::pair("sim_3", -0.008)}) {
    const CalibratedCamera& camera = Camera(*outcome.result, name);
    EXPECT_NEAR(camera.time_offset_s, offset_s, 3e-4);
    ASSERT_TRUE(camera.uncertainty);
    EXPECT_NEAR(camera.time_offset_s, offset_s, 4 * camera.uncertainty->time_offset_sigma_s);
  }
  EXPECT_LT(ComparePoses(Scaled(*outcome.result, world), world).worst_position_m, 0.002);
}

TEST(PointTarget, OutliersOfOneCameraAreRejected) {
  const SimulatedWorld world = PointWorld("cameras=5;duration=40;dropouts=0.4;outliers.2=0.3");
  const CalibrationOutcome outcome = Calibrate(InputOf(world), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_LT(ComparePoses(Scaled(*outcome.result, world), world).worst_position_m, 0.003);
  const Residuals& residuals = Camera(*outcome.result, "sim_2").residuals;
  EXPECT_NEAR(static_cast<double>(residuals.outlier_count) /
                  (residuals.outlier_count + residuals.inlier.marker_count),
              0.3, 0.05);
}

TEST(PointTarget, TwoCamerasAreEnough) {
  const SimulatedWorld world = PointWorld("cameras=2;duration=30");
  const CalibrationOutcome outcome = Calibrate(InputOf(world), {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_EQ(outcome.result->unit_camera, "sim_1");
  EXPECT_NEAR(outcome.result->cameras[1].cam_from_rig.translation_m.norm(), 1, 1e-9);
  const PoseErrors errors = ComparePoses(Scaled(*outcome.result, world), world);
  EXPECT_LT(errors.worst_rotation_rad, 0.003);
}

TEST(PointTarget, ScaleIsCarriedFromTripleToTriple) {
  const SimulatedWorld world = PointWorld("cameras=6;duration=60");
  const CalibrationInput input = OnlySeenBy(world, {{0, 1, 2}, {1, 2, 3}, {2, 3, 4}, {3, 4, 5}});
  const CalibrationOutcome outcome = Calibrate(input, {});
  ASSERT_THAT(outcome.result, IsOk());
  EXPECT_LT(ComparePoses(Scaled(*outcome.result, world), world).worst_position_m, 0.01);
}

TEST(PointTarget, SaysWhichCamerasMustSeeItAtOnce) {
  const SimulatedWorld world = PointWorld("cameras=5;duration=60");
  // One camera in common carries no scale.
  EXPECT_THAT(Calibrate(OnlySeenBy(world, {{0, 1, 2}, {2, 3, 4}}), {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("scale"), HasSubstr("sim_2"), HasSubstr("sim_3"),
                             HasSubstr("wave the marker where"))));
  // Nor do pairs.
  EXPECT_THAT(Calibrate(OnlySeenBy(world, {{0, 1}, {1, 2}, {2, 3}, {3, 4}}), {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("three cameras")));
  const SimulatedWorld four = PointWorld("cameras=4;duration=60");
  EXPECT_THAT(Calibrate(OnlySeenBy(four, {{0, 1}, {2, 3}}), {}).result,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not connected")));
  // Three that are connected are calibrated without the others.
  const CalibrationOutcome part = Calibrate(OnlySeenBy(world, {{0, 1, 2}, {3, 4}}), {});
  ASSERT_THAT(part.result, IsOk());
  EXPECT_EQ(part.result->cameras.size(), 3);
}

TEST(PointTarget, DistancesThatMakeNoSenseAreRefused) {
  const SimulatedWorld world = PointWorld("cameras=3;duration=5");
  const CalibrationInput input = InputOf(world);
  const auto with = [](KnownDistance known) {
    CalibrationOptions options;
    options.known_distance = known;
    return options;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double distance_m : {0.0, -1.0, nan, infinity}) {
    EXPECT_THAT(Calibrate(input, with({"sim_0", "sim_1", distance_m, 0.001})).result,
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("distance_m")));
  }
  for (const double sigma_m : {-0.001, nan, infinity, 5.0}) {
    EXPECT_THAT(Calibrate(input, with({"sim_0", "sim_1", 2, sigma_m})).result,
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("sigma_m")));
  }
  EXPECT_THAT(Calibrate(input, with({"sim_1", "sim_1", 2, 0.001})).result,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("sim_1 twice")));
  EXPECT_THAT(
      Calibrate(input, with({"sim_0", "cellar", 2, 0.001})).result,
      StatusIs(absl::StatusCode::kInvalidArgument, AllOf(HasSubstr("cellar"), HasSubstr("sim_2"))));
  CalibrationInput wand = input;
  wand.target = WandTarget();
  EXPECT_THAT(Calibrate(wand, with({"sim_0", "sim_1", 2, 0.001})).result,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("wand")));
}

}  // namespace
}  // namespace rigcal::server::point_target_test
