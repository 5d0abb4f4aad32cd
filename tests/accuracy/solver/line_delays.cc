// SPDX-License-Identifier: Apache-2.0
// Rolling shutters in every camera, 5 to 35 us a row, over many seeds. 25 observations per second,
// clocks up to 2 ms off, spacing and intrinsics right and fixed. Positions against the Cramer-Rao
// bound of poses, offsets and line delays together; line delays against their stated sigmas.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/rig/rig_information.h"
#include "tests/accuracy/rig/simulated_tracks.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/crb_experiment.h"
#include "tests/accuracy/solver/solver_experiments.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::accuracy {
namespace {

struct LineDelayTrial {
  absl::Status status;
  double squared_error_m2 = 0, bound_m2 = 0;  // of the positions
  double position_nees = 0;                   // by their stated sigmas, each coordinate by itself
  double delay_nees = 0, delay_error_s2 = 0, delay_bound_s2 = 0, worst_sigmas = 0;
  int cameras = 0, positions = 0;

  void Add(const LineDelayTrial& other) {
    squared_error_m2 += other.squared_error_m2;
    bound_m2 += other.bound_m2;
    position_nees += other.position_nees;
    delay_nees += other.delay_nees;
    delay_error_s2 += other.delay_error_s2;
    delay_bound_s2 += other.delay_bound_s2;
    worst_sigmas = std::max(worst_sigmas, other.worst_sigmas);
    cameras += other.cameras;
    positions += other.positions;
  }
};

absl::Status MeasureLineDelays(const SimulatedWorld& world, LineDelayTrial* trial) {
  CalibrationOptions options;
  options.intrinsics = options.marker_positions = Estimate::kFixed;
  const server::CalibrationOutcome outcome = server::Calibrate(server::InputOf(world), options);
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  const int reference = CameraIndex(world, outcome.result->reference_camera);
  InformationOptions estimated;
  estimated.time_offsets = estimated.line_delays = true;
  RIGCAL_ASSIGN_OR_RETURN(const RigBound bound,
                          ComputeRigBound(MakeTrueRig(world, reference), estimated));
  for (const CalibratedCamera& camera : outcome.result->cameras) {
    const int c = CameraIndex(world, camera.camera);
    if (!(camera.line_delay_sigma_s > 0)) {
      return absl::InternalError(absl::StrCat(camera.camera, " has no line delay"));
    }
    const double error_s =
        camera.line_delay_s - world.cameras()[static_cast<size_t>(c)].line_delay_s;
    const double sigmas = error_s / camera.line_delay_sigma_s;
    trial->delay_nees += sigmas * sigmas;
    trial->worst_sigmas = std::max(trial->worst_sigmas, std::abs(sigmas));
    trial->delay_error_s2 += error_s * error_s;
    const int own = bound.first_line_delay + c;
    trial->delay_bound_s2 += bound.covariance(own, own);
    ++trial->cameras;
    if (c == reference) continue;
    const Eigen::Vector3d error_m =
        ErrorOf(camera.cam_from_rig, TruePose(world, c, reference)).position_m;
    trial->squared_error_m2 += error_m.squaredNorm();
    trial->bound_m2 += bound.PositionCovariance(c).trace();
    if (!camera.uncertainty) continue;
    trial->position_nees +=
        error_m.cwiseQuotient(camera.uncertainty->position_sigma_m).squaredNorm();
    trial->positions += 3;
  }
  return absl::OkStatus();
}

LineDelayTrial RunLineDelayTrial(const SeedOptions& seeds, uint32_t seed) {
  SimulationOptions simulation;
  simulation.seed = seed;
  simulation.camera_count = seeds.camera_count;
  simulation.duration_s = seeds.duration_s;
  simulation.outlier_share = 0;
  RandomStream random{seed, 0x6c696e65};
  for (int c = 0; c < seeds.camera_count; ++c) {
    const double upwards = random.Uniform() < 0.3 ? -1 : 1;
    simulation.line_delay_s[c] = upwards * random.Uniform(5e-6, 35e-6);
    simulation.time_offset_s[c] = random.Uniform(-0.002, 0.002);
  }
  LineDelayTrial trial;
  const auto world = SimulatedWorld::Create(simulation, NamedTarget("wand"));
  trial.status = world.ok() ? MeasureLineDelays(*world, &trial) : world.status();
  return trial;
}

int RunLineDelays(const SeedOptions& seeds) {
  const auto trials = RunAll<LineDelayTrial>(seeds.count, seeds.threads, [&](int i) {
    return RunLineDelayTrial(seeds, static_cast<uint32_t>(seeds.first + i));
  });
  LineDelayTrial sum;
  int failures = 0;
  for (size_t i = 0; i < trials.size(); ++i) {
    const LineDelayTrial& trial = trials[i];
    const int seed = seeds.first + static_cast<int>(i);
    if (!trial.status.ok()) {
      fmt::print("seed {:4}: FAILED: {}\n", seed, trial.status.ToString());
      ++failures;
      continue;
    }
    if (seeds.verbose) {
      fmt::print("seed {:4}: RMSE/bound {:.3f}, line delays {:.3f} us, worst {:.1f} sigma\n", seed,
                 std::sqrt(trial.squared_error_m2 / trial.bound_m2),
                 1e6 * std::sqrt(trial.delay_error_s2 / trial.cameras), trial.worst_sigmas);
    }
    sum.Add(trial);
  }
  fmt::print("{} seeds, {} failed; {} cameras, {} s\n", seeds.count, failures, seeds.camera_count,
             seeds.duration_s);
  fmt::print("positions: RMSE/bound {:.3f}; mean squared error by stated sigma {:.3f}\n",
             std::sqrt(sum.squared_error_m2 / sum.bound_m2),
             sum.position_nees / std::max(1, sum.positions));
  fmt::print("line delays: RMS {:.3f} us, RMSE/bound {:.3f}, NEES/dof {:.3f}, worst {:.1f} sigma\n",
             1e6 * std::sqrt(sum.delay_error_s2 / std::max(1, sum.cameras)),
             std::sqrt(sum.delay_error_s2 / sum.delay_bound_s2),
             sum.delay_nees / std::max(1, sum.cameras), sum.worst_sigmas);
  return 0;
}

}  // namespace

Experiment LineDelays() {
  return SeedExperiment("line_delays", "rolling shutters in every camera against the bound",
                        SeedOptions{}, RunLineDelays);
}

}  // namespace rigcal::accuracy
