// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/starts_experiment.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <utility>
#include <vector>

#include "common/simulation/world/random_stream.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/rig/calibration_errors.h"
#include "tests/accuracy/rig/simulated_tracks.h"
#include "tests/accuracy/thread_cpu.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kStartsPurpose = 0x7374617274;

// When each camera starts is its time offset: all their stamps begin alike.
SimulationOptions DrawStarts(const StartsOptions& options, uint32_t seed) {
  SimulationOptions simulation;
  simulation.seed = seed;
  simulation.camera_count = options.camera_count;
  simulation.duration_s = options.duration_s + options.latest_start_s;
  simulation.jitter_s = options.jitter_s;
  simulation.max_speed_m_s = options.wand_speed_m_s;
  simulation.free_running = true;
  RandomStream random{seed, kStartsPurpose};
  for (int c = 0; c < options.camera_count; ++c) {
    simulation.camera_rate_hz[c] = random.Uniform(options.slowest_hz, options.fastest_hz);
    simulation.time_offset_s[c] = random.Uniform(0, options.latest_start_s);
  }
  return simulation;
}

// The rows that each camera took while it ran.
server::CalibrationInput Recorded(const SimulatedWorld& world, const SimulationOptions& starts,
                                  double duration_s) {
  server::CalibrationInput input = server::InputOf(world);
  for (size_t c = 0; c < input.tracks.size(); ++c) {
    const int camera = static_cast<int>(c);
    std::vector<Observation> rows;
    for (int i = 0; i < world.FrameCount(camera); ++i) {
      const double ran_s = world.FrameRigTime(camera, i) - starts.time_offset_s.at(camera);
      if (ran_s < 0 || ran_s >= duration_s) continue;
      rows.push_back(std::move(input.tracks[c].observations[static_cast<size_t>(i)]));
    }
    input.tracks[c].observations = std::move(rows);
  }
  return input;
}

// The largest error of an offset, both sides against the median of their clocks.
double WorstOffsetS(const SimulatedWorld& world, const CalibrationResult& result) {
  std::vector<double> errors_s;
  for (const CalibratedCamera& camera : result.cameras) {
    const int index = CameraIndex(world, camera.camera);
    errors_s.push_back(camera.time_offset_s -
                       world.cameras()[static_cast<size_t>(index)].time_offset_s);
  }
  const double median_s = Median(errors_s);
  double worst_s = 0;
  for (const double error_s : errors_s) worst_s = std::max(worst_s, std::abs(error_s - median_s));
  return worst_s;
}

absl::Status MeasureStarts(const SimulatedWorld& world, server::CalibrationInput input,
                           StartsRun* run) {
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  const double before_s = ThreadCpuS();
  const server::CalibrationOutcome outcome = server::Calibrate(std::move(input), options);
  run->cpu_s = ThreadCpuS() - before_s;
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  run->worst_offset_s = WorstOffsetS(world, *outcome.result);
  if (world.target().kind == TargetKind::kPoint) return absl::OkStatus();
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationErrors errors,
                          CompareWithGroundTruth(world, *outcome.result));
  run->position_rms_m = errors.PositionRmsM();
  return absl::OkStatus();
}

StartsRun RunStarts(const SimulationOptions& simulation, const SimulationOptions& starts,
                    const StartsOptions& options) {
  Target target;
  target.kind = options.is_point ? TargetKind::kPoint : TargetKind::kWand;
  target.marker_positions_m =
      options.is_point ? std::vector<double>{0} : std::vector<double>{0, 0.13, 0.39};
  StartsRun run;
  const absl::StatusOr<SimulatedWorld> world = SimulatedWorld::Create(simulation, target);
  run.status = world.ok()
                   ? MeasureStarts(*world, Recorded(*world, starts, options.duration_s), &run)
                   : world.status();
  return run;
}

}  // namespace

StartsTrial RunStartsTrial(const StartsOptions& options, uint32_t seed) {
  const SimulationOptions starts = DrawStarts(options, seed);
  SimulationOptions aligned = starts;
  aligned.time_offset_s.clear();
  return {RunStarts(aligned, starts, options), RunStarts(starts, starts, options)};
}

}  // namespace rigcal::accuracy
