// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/robustness_experiment.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/status/status_macros.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/rig/calibration_errors.h"
#include "tests/accuracy/rig/rig_information.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::accuracy {
namespace {

constexpr int kBadCamera = 2;

absl::Status Measure(const SimulatedWorld& world, RobustnessTrial* trial) {
  server::CalibrationHooks hooks;
  hooks.solved = [&](const server::RigObservations& rig, const server::RigSolution& solution) {
    trial->fates = CountFates(world, rig, solution);
  };
  const server::CalibrationOutcome outcome = server::Calibrate(server::InputOf(world), {}, hooks);
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationErrors errors,
                          CompareWithGroundTruth(world, *outcome.result));
  trial->position_rms_m = errors.PositionRmsM();
  // The bound is that of correct labels.
  SimulationOptions unflipped = world.options();
  unflipped.swap_share = 0;
  RIGCAL_ASSIGN_OR_RETURN(const SimulatedWorld unflipped_world,
                          SimulatedWorld::Create(unflipped, world.target()));
  RIGCAL_ASSIGN_OR_RETURN(const RigBound bound,
                          ComputeRigBound(MakeTrueRig(unflipped_world, errors.reference), {}));
  double trace = 0;
  for (int c = 0; c < bound.camera_count; ++c) {
    if (c != bound.reference_camera) trace += bound.PositionCovariance(c).trace();
  }
  trial->bound_rms_m = std::sqrt(trace / (bound.camera_count - 1));
  return absl::OkStatus();
}

}  // namespace

std::vector<RobustnessCase> RobustnessCases(int camera_count, double duration_s) {
  SimulationOptions clean;
  clean.camera_count = camera_count;
  clean.duration_s = duration_s;
  clean.outlier_share = clean.dropout_share = 0;
  SimulationOptions all = clean;
  const auto put = [&all, &clean](auto change) {
    SimulationOptions changed = clean;
    change(&changed);
    change(&all);
    return changed;
  };
  std::vector<RobustnessCase> cases;
  cases.push_back({"clean", clean});
  cases.push_back(
      {"30 % outliers", put([](SimulationOptions* options) {
         options->camera_outlier_share[std::min(kBadCamera, options->camera_count - 1)] = 0.3;
       })});
  cases.push_back(
      {"5 % flipped", put([](SimulationOptions* options) { options->swap_share = 0.05; })});
  cases.push_back(
      {"40 % dropouts", put([](SimulationOptions* options) { options->dropout_share = 0.4; })});
  cases.push_back({"10 s gap", put([](SimulationOptions* options) {
                     options->gap_start_s = 0.4 * options->duration_s;
                     options->gap_duration_s = 10;
                   })});
  cases.push_back({"all of them", all});
  return cases;
}

RobustnessTrial RunRobustnessTrial(const RobustnessCase& entry, uint32_t seed) {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  SimulationOptions simulation = entry.simulation;
  simulation.seed = seed;
  RobustnessTrial trial;
  const absl::StatusOr<SimulatedWorld> world = SimulatedWorld::Create(simulation, target);
  trial.status = world.ok() ? Measure(*world, &trial) : world.status();
  return trial;
}

double RatioOfRms(const std::vector<RobustnessTrial>& trials,
                  const std::vector<RobustnessTrial>& clean) {
  double above = 0, below = 0;
  for (size_t i = 0; i < trials.size(); ++i) {
    if (!trials[i].status.ok() || !clean[i].status.ok()) continue;
    above += trials[i].position_rms_m * trials[i].position_rms_m;
    below += clean[i].position_rms_m * clean[i].position_rms_m;
  }
  return std::sqrt(above / below);
}

}  // namespace rigcal::accuracy
