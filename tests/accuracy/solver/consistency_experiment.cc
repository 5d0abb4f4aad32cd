// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/consistency_experiment.h"

#include <cmath>
#include <utility>

#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"
#include "server/solve/calibrate.h"
#include "server/solve/rig/intrinsics_prior.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kOffsetPurpose = 0x686f6e;

SimulationOptions DrawWorld(const ConsistencyOptions& options, const Target& target,
                            uint32_t seed) {
  const server::IntrinsicsPrior prior;
  SimulationOptions simulation;
  simulation.seed = seed;
  simulation.camera_count = options.camera_count;
  simulation.duration_s = options.duration_s;
  simulation.outlier_share = options.outlier_share;
  simulation.length_sigma_m = target.span_tolerance_m;
  simulation.focal_sigma_rel = prior.focal_share;
  simulation.centre_sigma_px = prior.centre_share * 1280;  // the simulated cameras' width
  simulation.radial_sigma = prior.radial;
  simulation.radial_high_sigma = prior.radial_high;
  simulation.tangential_sigma = prior.tangential;
  RandomStream random{seed, kOffsetPurpose};
  for (int c = 0; c < options.camera_count; ++c) {
    simulation.time_offset_s[c] = options.offset_sigma_s * random.Gaussian();
  }
  return simulation;
}

InformationOptions Everything(const SimulatedWorld& world) {
  server::BundleCamera camera;
  server::SetIntrinsicsPrior(world.cameras().front().description, &camera);
  InformationOptions options;
  options.marker_positions = options.time_offsets = options.intrinsics = true;
  options.span_sigma_m = world.target().span_tolerance_m;
  options.intrinsics_sigma = camera.intrinsics_sigma;
  return options;
}

void Append(double error, double sigma, std::vector<double>* squares) {
  if (sigma > 0) squares->push_back(error * error / (sigma * sigma));
}

void CompareWithSigmas(const CalibrationErrors& errors, const CalibrationResult& result,
                       ConsistencyTrial* trial) {
  for (size_t c = 0; c < errors.cameras.size(); ++c) {
    const CameraError& camera = errors.cameras[c];
    if (!camera.sigma) continue;
    // The sigmas of the poses are those of the shape; the scale has its own.
    const Eigen::Vector3d position_m = errors.PositionErrorAtTrueLengthM(c);
    for (int i = 0; i < 3; ++i) {
      Append(camera.pose.rotation_rad[i], camera.sigma->rotation_sigma_rad[i], &trial->rotation);
      Append(position_m[i], camera.sigma->position_sigma_m[i], &trial->position);
    }
    Append(camera.time_offset_s, camera.sigma->time_offset_sigma_s, &trial->time_offset);
    const std::vector<double>& sigmas = camera.sigma->intrinsics_sigma;
    for (size_t i = 0; i < sigmas.size() && i < camera.intrinsics.size(); ++i) {
      Append(camera.intrinsics[i], sigmas[i], &trial->intrinsics);
    }
  }
  Append(errors.target_length_rel, result.target.scale_sigma_rel, &trial->scale);
}

absl::Status Measure(const SimulatedWorld& world, ConsistencyTrial* trial) {
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = options.marker_positions = Estimate::kRefined;
  absl::StatusOr<RigCovariance> stated = absl::UnavailableError("the solve did not call its hook");
  server::CalibrationHooks hooks;
  hooks.solved = [&](const server::RigObservations&, const server::RigSolution& solution) {
    stated = FromSolution(world, solution);
  };
  const server::CalibrationOutcome outcome =
      server::Calibrate(server::InputOf(world), options, hooks);
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationErrors errors,
                          CompareWithGroundTruth(world, *outcome.result));
  if (!absl::IsUnavailable(stated.status())) {
    RIGCAL_RETURN_IF_ERROR(stated.status());
    trial->stated = NormaliseErrors(errors, *stated);
  }
  const InformationOptions everything = Everything(world);
  RIGCAL_ASSIGN_OR_RETURN(const RigBound bound,
                          ComputeRigBound(MakeTrueRig(world, errors.reference), everything));
  trial->bound = NormaliseErrors(errors, FromBound(bound, everything));
  CompareWithSigmas(errors, *outcome.result, trial);
  return absl::OkStatus();
}

}  // namespace

ConsistencyTrial RunConsistencyTrial(const ConsistencyOptions& options, uint32_t seed) {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  ConsistencyTrial trial;
  const absl::StatusOr<SimulatedWorld> world =
      SimulatedWorld::Create(DrawWorld(options, target, seed), target);
  trial.status = world.ok() ? Measure(*world, &trial) : world.status();
  return trial;
}

std::vector<ConsistencyPart> SummariseParts(const std::vector<ConsistencyTrial>& trials) {
  const std::pair<const char*, Nees RigNees::*> parts[] = {
      {"shape", &RigNees::shape},           {"scale", &RigNees::scale},
      {"offsets", &RigNees::time_offsets},  {"rates", &RigNees::time_rates},
      {"intrinsics", &RigNees::intrinsics}, {"spacing", &RigNees::marker_positions},
  };
  std::vector<ConsistencyPart> summary;
  for (const auto& [name, part] : parts) {
    ConsistencyPart entry;
    entry.name = name;
    for (const ConsistencyTrial& trial : trials) {
      if (!trial.status.ok()) continue;
      if (trial.stated) entry.stated.Add((*trial.stated).*part);
      entry.bound.Add(trial.bound.*part);
    }
    summary.push_back(std::move(entry));
  }
  return summary;
}

std::vector<MarginalPart> SummariseSigmas(const std::vector<ConsistencyTrial>& trials) {
  const std::pair<const char*, std::vector<double> ConsistencyTrial::*> parts[] = {
      {"rotation", &ConsistencyTrial::rotation},     {"position", &ConsistencyTrial::position},
      {"offsets", &ConsistencyTrial::time_offset},   {"intrinsics", &ConsistencyTrial::intrinsics},
      {"scale_sigma_rel", &ConsistencyTrial::scale},
  };
  std::vector<MarginalPart> summary;
  for (const auto& [name, part] : parts) {
    std::vector<double> means;
    for (const ConsistencyTrial& trial : trials) {
      if (trial.status.ok() && !(trial.*part).empty()) means.push_back(Mean(trial.*part));
    }
    MarginalPart entry;
    entry.name = name;
    entry.trials = static_cast<int>(means.size());
    if (entry.trials > 1) {
      entry.mean = Mean(means);
      for (double& value : means) value -= entry.mean;
      const double half = 2.58 * RootMeanSquare(means) / std::sqrt(entry.trials - 1.0);
      entry.interval = {entry.mean - half, entry.mean + half};
    }
    summary.push_back(std::move(entry));
  }
  return summary;
}

}  // namespace rigcal::accuracy
