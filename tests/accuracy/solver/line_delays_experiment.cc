// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/line_delays_experiment.h"

#include <algorithm>
#include <cmath>

#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/rig/rig_information.h"
#include "tests/accuracy/rig/simulated_tracks.h"
#include "tests/accuracy/thread_cpu.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kShutterPurpose = 0x6c696e65;
constexpr double kUpwardsShare = 0.3;
constexpr double kMostOfPeriod = 0.9;
constexpr double kImageRows = 1024;

SimulationOptions DrawShutters(const LineDelaysOptions& options, uint32_t seed) {
  SimulationOptions simulation;
  simulation.seed = seed;
  simulation.camera_count = options.camera_count;
  simulation.duration_s = options.duration_s;
  simulation.rate_hz = options.rate_hz;
  simulation.free_running = options.free_running;
  simulation.outlier_share = 0;
  simulation.max_speed_m_s = options.speed_m_s;
  RandomStream random{seed, kShutterPurpose};
  for (int c = 0; c < options.camera_count; ++c) {
    const double upwards = random.Uniform() < kUpwardsShare ? -1 : 1;
    // An image is read within its frame's period.
    const double most_s = kMostOfPeriod / options.rate_hz / kImageRows;
    simulation.line_delay_s[c] =
        upwards * std::min(most_s, random.Uniform(options.shortest_s, options.longest_s));
    simulation.time_offset_s[c] =
        random.Uniform(-options.largest_offset_s, options.largest_offset_s);
  }
  return simulation;
}

absl::Status MeasureShutters(const SimulatedWorld& world, TrajectoryChoice trajectory,
                             LineDelaysTrial* trial) {
  CalibrationOptions options;
  options.trajectory = trajectory;
  options.intrinsics = options.marker_positions = Estimate::kFixed;
  absl::StatusOr<RigCovariance> stated = absl::UnavailableError("the solve did not call its hook");
  server::CalibrationHooks hooks;
  hooks.solved = [&](const server::RigObservations&, const server::RigSolution& solution) {
    stated = FromSolution(world, solution);
  };
  const double begin_s = ThreadCpuS();
  const server::CalibrationOutcome outcome =
      server::Calibrate(server::InputOf(world), options, hooks);
  trial->cpu_s = ThreadCpuS() - begin_s;
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  RIGCAL_RETURN_IF_ERROR(stated.status());
  trial->spline = outcome.result->trajectory.kind == CalibratedTrajectory::Kind::kSpline;
  trial->grade = outcome.result->quality.grade;
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationErrors errors,
                          CompareWithGroundTruth(world, *outcome.result));
  trial->stated = NormaliseErrors(errors, *stated);
  InformationOptions estimated;
  estimated.time_offsets = estimated.line_delays = true;
  RIGCAL_ASSIGN_OR_RETURN(const RigBound bound,
                          ComputeRigBound(MakeTrueRig(world, errors.reference), estimated));
  double reference_s = 0;
  for (const CameraError& camera : errors.cameras) {
    if (camera.is_reference) reference_s = camera.time_offset_s;
  }
  for (size_t i = 0; i < errors.cameras.size(); ++i) {
    const CameraError& camera = errors.cameras[i];
    ++trial->camera_count;
    trial->missed += outcome.result->cameras[i].line_delay_sigma_s > 0 ? 0 : 1;
    const int delay = bound.first_line_delay + camera.index;
    trial->delay_error_s2 += camera.line_delay_s * camera.line_delay_s;
    trial->delay_bound_s2 += bound.covariance(delay, delay);
    if (camera.is_reference) continue;
    trial->squared_error_m2 += camera.pose.position_m.squaredNorm();
    trial->bound_m2 += bound.PositionCovariance(camera.index).trace();
    const int offset = bound.TimeOffsetIndex(camera.index);
    const double offset_error_s = camera.time_offset_s - reference_s;
    trial->worst_offset_s = std::max(trial->worst_offset_s, std::abs(offset_error_s));
    trial->offset_error_s2 += offset_error_s * offset_error_s;
    trial->offset_bound_s2 += bound.covariance(offset, offset);
  }
  return absl::OkStatus();
}

}  // namespace

LineDelaysTrial RunLineDelaysTrial(const LineDelaysOptions& options, uint32_t seed) {
  LineDelaysTrial trial;
  const auto world = SimulatedWorld::Create(DrawShutters(options, seed), options.target);
  trial.status = world.ok() ? MeasureShutters(*world, options.trajectory, &trial) : world.status();
  return trial;
}

LineDelaysSummary Summarise(const std::vector<LineDelaysTrial>& trials) {
  LineDelaysSummary summary;
  LineDelaysTrial sum;
  int cameras = 0;
  for (const LineDelaysTrial& trial : trials) {
    if (!trial.status.ok()) {
      ++summary.failed;
      continue;
    }
    cameras += trial.camera_count;
    summary.missed += trial.missed;
    summary.splines += trial.spline ? 1 : 0;
    summary.good += trial.grade == QualityGrade::kGood ? 1 : 0;
    sum.squared_error_m2 += trial.squared_error_m2;
    sum.bound_m2 += trial.bound_m2;
    sum.delay_error_s2 += trial.delay_error_s2;
    sum.delay_bound_s2 += trial.delay_bound_s2;
    sum.offset_error_s2 += trial.offset_error_s2;
    sum.offset_bound_s2 += trial.offset_bound_s2;
    summary.shape.Add(trial.stated->shape);
    summary.scale.Add(trial.stated->scale);
    summary.offsets.Add(trial.stated->time_offsets);
    summary.delays.Add(trial.stated->line_delays);
  }
  summary.rmse_by_bound = std::sqrt(sum.squared_error_m2 / sum.bound_m2);
  summary.delay_by_bound = std::sqrt(sum.delay_error_s2 / sum.delay_bound_s2);
  summary.offset_by_bound = std::sqrt(sum.offset_error_s2 / sum.offset_bound_s2);
  summary.delay_rms_s = cameras == 0 ? 0 : std::sqrt(sum.delay_error_s2 / cameras);
  return summary;
}

}  // namespace rigcal::accuracy
