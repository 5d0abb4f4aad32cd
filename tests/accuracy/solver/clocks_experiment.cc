// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/clocks_experiment.h"

#include <cmath>
#include <utility>

#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"
#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kClockPurpose = 0x636c6b;
constexpr double kRatesHz[] = {50, 60, 120};

SimulationOptions DrawWorld(const ClocksOptions& options, uint32_t seed) {
  SimulationOptions simulation;
  simulation.seed = seed;
  simulation.camera_count = options.camera_count;
  simulation.duration_s = options.duration_s;
  simulation.jitter_s = options.jitter_s;
  simulation.max_speed_m_s = options.wand_speed_m_s;
  simulation.free_running = options.free_running;
  simulation.clock_samples = options.clock_samples;
  RandomStream random{seed, kClockPurpose};
  for (int c = 0; c < options.camera_count; ++c) {
    if (options.free_running) simulation.camera_rate_hz[c] = kRatesHz[c % 3];
    simulation.time_offset_s[c] =
        random.Uniform(-options.largest_offset_s, options.largest_offset_s);
    simulation.time_rate_ppm[c] =
        random.Uniform(-options.largest_rate_ppm, options.largest_rate_ppm);
  }
  return simulation;
}

// Index of a camera's time offset in a covariance; -1 for the reference.
int OffsetRow(const RigCovariance& covariance, int camera) {
  for (size_t i = 0; i < covariance.parameters.size(); ++i) {
    const RigParameter& parameter = covariance.parameters[i];
    if (parameter.kind == RigParameterKind::kTimeOffset && parameter.camera == camera) {
      return static_cast<int>(i);
    }
  }
  return -1;
}

absl::Status Measure(const SimulatedWorld& world, ClocksTrial* trial) {
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  absl::StatusOr<RigCovariance> covariance =
      absl::UnavailableError("the solve did not call its hook");
  server::CalibrationHooks hooks;
  hooks.solved = [&](const server::RigObservations&, const server::RigSolution& solution) {
    covariance = FromSolution(world, solution);
  };
  const server::CalibrationOutcome outcome =
      server::Calibrate(server::InputOf(world), options, hooks);
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationErrors errors,
                          CompareWithGroundTruth(world, *outcome.result));
  trial->position_rms_m = errors.PositionRmsM();
  if (covariance.ok()) trial->stated = NormaliseErrors(errors, *covariance);
  double reference_offset_s = 0;
  for (const CameraError& camera : errors.cameras) {
    if (camera.is_reference) reference_offset_s = camera.time_offset_s;
  }
  for (const CameraError& camera : errors.cameras) {
    ClockError clock;
    clock.camera = camera.camera;
    clock.offset_s = camera.time_offset_s;
    clock.rate_ppm = camera.time_rate_ppm;
    clock.offset_against_reference_s = camera.time_offset_s - reference_offset_s;
    if (camera.sigma) clock.stated_sigma_s = camera.sigma->time_offset_sigma_s;
    const int row = covariance.ok() ? OffsetRow(*covariance, camera.index) : -1;
    if (row >= 0) clock.covariance_sigma_s = std::sqrt(covariance->matrix(row, row));
    trial->clocks.push_back(std::move(clock));
  }
  return absl::OkStatus();
}

}  // namespace

ClocksTrial RunClocksTrial(const ClocksOptions& options, uint32_t seed) {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  ClocksTrial trial;
  const absl::StatusOr<SimulatedWorld> world =
      SimulatedWorld::Create(DrawWorld(options, seed), target);
  trial.status = world.ok() ? Measure(*world, &trial) : world.status();
  return trial;
}

}  // namespace rigcal::accuracy
