// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/sphere_centres.h"

#include <gtest/gtest.h>

#include "common/camera/sphere_projection.h"
#include "server/associate/clean_track.h"
#include "server/solve/evaluate/evaluated_solve.h"
#include "server/solve/rig/rig_solver.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::sphere_centres_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;

// Three times the usual: the offset grows with the square.
constexpr double kDiameterM = 0.12;
constexpr char kQuiet[] = "cameras=4;duration=20;noise=0.05;outliers=0;dropouts=0";

SimulatedWorld World(double diameter_m, const Target& wand = WandTarget()) {
  Target target = wand;
  target.diameter_m = diameter_m;
  auto world = SimulatedWorld::Create(*ParseSimulationOptions(kQuiet), target);
  EXPECT_THAT(world, IsOk());
  return *std::move(world);
}

// Observations of a camera that measures image blobs instead of sphere centres.
CalibrationInput BlobsOf(const SimulatedWorld& world, CentreKind said = CentreKind::kImageBlob) {
  CalibrationInput input = InputOf(world);
  for (size_t c = 0; c < input.tracks.size(); ++c) {
    const SimulatedCamera& camera = world.cameras()[c];
    for (size_t i = 0; i < input.tracks[c].observations.size(); ++i) {
      const WandPose wand =
          world.WandAt(world.FrameRigTime(static_cast<int>(c), static_cast<int>(i)));
      auto& markers = input.tracks[c].observations[i].markers;
      for (size_t m = 0; m < markers.size(); ++m) {
        if (!markers[m].visible) continue;
        const Eigen::Vector3d at =
            wand.origin_m + world.true_target().marker_positions_m[m] * wand.direction;
        SphereProjection image;
        EXPECT_TRUE(
            ProjectSphere(camera.true_intrinsics, camera.cam_from_rig * at, kDiameterM, &image));
        markers[m].centre_px += image.centroid_px - image.centre_px;
        markers[m].centre_kind = said;
      }
    }
  }
  return input;
}

CalibrationResult Solved(const CalibrationInput& input) {
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(input, options);
  EXPECT_THAT(outcome.result, IsOk());
  return outcome.result.ok() ? *outcome.result : CalibrationResult{};
}

double MeanPx(const CalibrationResult& result) {
  double sum = 0;
  for (const CalibratedCamera& camera : result.cameras) sum += camera.residuals.all.mean_px;
  return sum / static_cast<double>(result.cameras.size());
}

TEST(SphereCentres, BlobsAreAsGoodAsCentres) {
  const SimulatedWorld world = World(kDiameterM);
  const CalibrationResult centres = Solved(InputOf(world)), blobs = Solved(BlobsOf(world));
  const CalibrationResult wrong = Solved(BlobsOf(world, CentreKind::kSphereCentre));
  const PoseErrors of_centres = ComparePoses(centres, world), of_blobs = ComparePoses(blobs, world);
  // The adjustment ends with the scale some 1e-5 from where more steps would take it.
  EXPECT_NEAR(of_blobs.worst_position_m, of_centres.worst_position_m, 5e-5);
  EXPECT_NEAR(of_blobs.worst_rotation_rad, of_centres.worst_rotation_rad, 1e-6);
  EXPECT_NEAR(MeanPx(blobs), MeanPx(centres), 0.002);
  EXPECT_NEAR(blobs.target.length_error_rms_m, centres.target.length_error_rms_m, 1e-5);
  EXPECT_GT(ComparePoses(wrong, world).worst_position_m, 3e-4);
}

TEST(SphereCentres, AreLeftWithoutADiameter) {
  const SimulatedWorld world = World(0);
  CalibrationInput as_blobs = InputOf(world);
  for (CameraTrack& track : as_blobs.tracks) {
    for (Observation& observation : track.observations) {
      for (MarkerObservation& marker : observation.markers) {
        marker.centre_kind = CentreKind::kImageBlob;
      }
    }
  }
  const CalibrationResult a = Solved(InputOf(world)), b = Solved(as_blobs);
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    EXPECT_EQ(a.cameras[c].cam_from_rig.Matrix(), b.cameras[c].cam_from_rig.Matrix());
  }
}

struct Placed {
  Target target;
  RigObservations rig;
  std::vector<ImageMotion> motions;
  BuiltProblem built;  // as observed, its instants as they were solved
};

Placed Place(const CalibrationInput& input) {
  Placed placed;
  std::vector<ClockCorrection> clocks;
  placed.rig = RigOf(input, &clocks);
  placed.target = input.target;
  const auto solution = SolveRig(placed.rig, clocks, {});
  EXPECT_THAT(solution, IsOk());
  if (!solution.ok()) return placed;
  placed.motions = solution->motions;
  placed.built = BuildProblem(placed.target, placed.rig.tracks, placed.motions, placed.rig.index,
                              solution->clocks, solution->instants.instants, 0);
  placed.built.problem.cameras = solution->built.problem.cameras;
  placed.built.problem.instants = solution->built.problem.instants;
  return placed;
}

TEST(SphereCentres, MovesWhatIsUsedAndAnImage) {
  CalibrationInput input = BlobsOf(World(kDiameterM));
  for (Observation& observation : input.tracks[1].observations) {
    for (MarkerObservation& marker : observation.markers) {
      marker.centre_kind = CentreKind::kSphereCentre;
    }
  }
  Placed placed = Place(input);
  ASSERT_GT(placed.built.problem.instants.size(), 50u);
  placed.built.problem.instants[3].used = false;
  const BuiltProblem before = placed.built;
  const int moved =
      CorrectSphereCentres(placed.target, placed.rig.tracks, placed.motions, true, &placed.built);
  int expected = 0;
  for (size_t i = 0; i < before.problem.instants.size(); ++i) {
    const BundleInstant& instant = before.problem.instants[i];
    for (int o = 0; o < instant.observation_count; ++o) {
      const BundleObservation& observation =
          before.problem.observations[static_cast<size_t>(instant.first_observation + o)];
      for (int m = 0; m < observation.marker_count; ++m) {
        const auto index = static_cast<size_t>(observation.first_marker + m);
        const double by_px = (placed.built.problem.markers[index].centre_px -
                              before.problem.markers[index].centre_px)
                                 .norm();
        const bool due = instant.used && observation.camera != 1;
        expected += due ? 1 : 0;
        EXPECT_LE(by_px, due ? 5 : 0);
      }
    }
  }
  EXPECT_EQ(moved, expected);
  EXPECT_GT(moved, 100);
}

TEST(SphereCentres, NeedsMetres) {
  Placed placed = Place(BlobsOf(World(kDiameterM)));
  EXPECT_EQ(
      CorrectSphereCentres(placed.target, placed.rig.tracks, placed.motions, false, &placed.built),
      0);
  placed.target.diameter_m = 0;
  EXPECT_EQ(
      CorrectSphereCentres(placed.target, placed.rig.tracks, placed.motions, true, &placed.built),
      0);
}

TEST(SphereCentres, MetresComeFromTheWandOrADistance) {
  RigObservations rig;
  rig.target = WandTarget();
  EXPECT_TRUE(IsMetric(rig, {}));
  rig.target = *ParseTarget("point");
  EXPECT_FALSE(IsMetric(rig, {}));
  RigSolveOptions options;
  options.known_distance = BundleDistance{0, 1, 2.5};
  EXPECT_TRUE(IsMetric(rig, options));
}

}  // namespace
}  // namespace rigcal::server::sphere_centres_test
