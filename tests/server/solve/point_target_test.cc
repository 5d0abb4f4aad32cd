// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server {
namespace {

using rigcal::testing::IsOk;
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

const CalibratedCamera& Camera(const CalibrationResult& result, const std::string& name) {
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

// Cameras see no marker in the instants of the second list that they are not named in: blocks of
// equal length, one after the other.
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

}  // namespace
}  // namespace rigcal::server
