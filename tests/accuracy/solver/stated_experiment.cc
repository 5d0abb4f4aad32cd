// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/stated_experiment.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_world.h"
#include "common/status/status_macros.h"
#include "server/solve/calibrate.h"
#include "server/solve/evaluate/attached_point.h"
#include "server/solve/headline.h"
#include "server/solve/running/running_estimate.h"
#include "tests/accuracy/solver/rig_comparison.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kStatedPurpose = 0x737461746564;
constexpr size_t kPlaces = 1000;

SimulationOptions DrawWorld(const StatedOptions& options, uint32_t seed) {
  SimulationOptions simulation;
  simulation.seed = seed;
  simulation.camera_count = options.camera_count;
  simulation.duration_s = options.duration_s;
  simulation.focal_sigma_rel = 0.002 * options.lens_error;
  simulation.centre_sigma_px = 2 * options.lens_error;
  simulation.radial_sigma = 0.004 * options.lens_error;
  simulation.radial_high_sigma = 0.008 * options.lens_error;
  simulation.tangential_sigma = 0.0002 * options.lens_error;
  if (!options.moved_clocks) return simulation;
  RandomStream random{seed, kStatedPurpose};
  for (int c = 0; c < options.camera_count; ++c) {
    simulation.time_offset_s[c] = random.Uniform(-0.005, 0.005);
  }
  return simulation;
}

server::CalibrationInput InputOf(const SimulatedWorld& world, bool upright) {
  server::CalibrationInput input;
  input.target = world.target();
  const double half_m = 0.5 * world.true_target().marker_positions_m.back();
  for (int c = 0; c < static_cast<int>(world.cameras().size()); ++c) {
    server::CameraTrack& track = input.tracks.emplace_back();
    track.session_id = "s";
    track.camera = world.cameras()[static_cast<size_t>(c)].description;
    for (int i = 0; i < world.FrameCount(c); ++i) {
      WandPose pose = world.WandAt(world.FrameRigTime(c, i));
      if (upright) {
        const Eigen::Vector3d middle_m = pose.At(half_m);
        pose.direction = Eigen::Vector3d::UnitZ();
        pose.origin_m = middle_m - half_m * pose.direction;
      }
      track.observations.push_back(world.ObserveWand(c, i, pose));
    }
  }
  return input;
}

std::vector<RigidTransform> PosesOf(const ComparedRig& rig) {
  std::vector<RigidTransform> cam_from_rig;
  for (const ComparedRig::Camera& camera : rig.cameras) cam_from_rig.push_back(camera.cam_from_rig);
  return cam_from_rig;
}

// The places of the headline, in the frame of the truth.
std::vector<Eigen::Vector3d> PlacesIn(const ComparedRig& truth, const ComparedRig& found,
                                      const server::RigObservations& rig,
                                      const server::EvaluatedSolution& evaluated) {
  const server::BundleProblem& problem = evaluated.solution.built.problem;
  const server::WavedGrid grid = server::MeasureWavedGrid(problem, kPlaces);
  const server::PointGains gains =
      server::ComputeGains(problem, rig.index.cameras, evaluated.uncertainty->parameters, grid, 1);
  const Eigen::Isometry3d truth_from_found = Align(found, truth);
  std::vector<Eigen::Vector3d> places_m = server::PlacesOf(gains, grid);
  for (Eigen::Vector3d& place_m : places_m) place_m = truth_from_found * place_m;
  return places_m;
}

absl::Status Measure(const SimulatedWorld& world, const StatedOptions& options,
                     StatedTrial* trial) {
  const server::CalibrationInput input = InputOf(world, options.upright);
  const ComparedRig truth = RigOf(world);
  server::RunningInput running;
  running.target = input.target;
  running.tracks = input.tracks;
  running.advise = false;
  const server::RunningOutcome live = server::EstimateNow(std::move(running));
  if (live.estimate && live.estimate->cameras.size() == truth.cameras.size()) {
    trial->live_mm = 1e3 * live.estimate->error.p95_m;
    trial->live_true_mm =
        1e3 * TriangulationErrorM(truth, RigOf(*live.estimate), PointsOf(*live.estimate, truth));
  }
  CalibrationOptions calibration;
  calibration.intrinsics = options.intrinsics;
  std::optional<server::PointError> error;
  std::vector<Eigen::Vector3d> places_m;
  server::CalibrationHooks hooks;
  hooks.evaluated = [&](const server::RigObservations& rig,
                        const server::EvaluatedSolution& evaluated) {
    error = server::MeasurePointError(rig, evaluated);
    if (!error) return;
    ComparedRig found;
    for (const server::BundleCamera& camera : evaluated.solution.built.problem.cameras) {
      found.cameras.push_back({camera.name, {}, camera.cam_from_rig, {}});
    }
    places_m = PlacesIn(truth, found, rig, evaluated);
    trial->centre_sigma_mm = 1e3 * evaluated.predicted.sigma_m;
    if (found.cameras.size() != truth.cameras.size()) return;
    const std::vector<double> distances_m = server::FrameFreeCentreDistances(
        PosesOf(found), PosesOf(truth), server::MiddleOfWave(evaluated.solution.built.problem));
    trial->centre_true_mm = 1e3 * *std::ranges::max_element(distances_m);
  };
  const server::CalibrationOutcome outcome = server::Calibrate(input, calibration, hooks);
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  if (!error) return absl::InternalError("the calibration states no error of a point");
  const CalibrationResult& result = *outcome.result;
  trial->covariance_mm = 1e3 * error->by_covariance_m;
  trial->lenses_mm = 1e3 * error->with_lenses_m;
  trial->stated_mm = 1e3 * error->StatedM();
  trial->bound_mm = 1e3 * error->BoundM();
  trial->basis = error->Basis();
  trial->true_mm = 1e3 * TriangulationErrorM(truth, RigOf(result), places_m);
  trial->grade = result.quality.grade;
  if (!result.quality.reasons.empty()) trial->reason = result.quality.reasons.front();
  trial->refined = result.cameras.front().intrinsics_refined;
  return absl::OkStatus();
}

}  // namespace

StatedTrial RunStatedTrial(const StatedOptions& options, uint32_t seed) {
  Target target;
  for (const double position_m : {0.0, 0.13, 0.39}) {
    target.marker_positions_m.push_back(options.wand_scale * position_m);
  }
  StatedTrial trial;
  const absl::StatusOr<SimulatedWorld> world =
      SimulatedWorld::Create(DrawWorld(options, seed), target);
  trial.status = world.ok() ? Measure(*world, options, &trial) : world.status();
  return trial;
}

}  // namespace rigcal::accuracy
