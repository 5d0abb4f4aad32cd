// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/sparse_experiment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "common/camera/intrinsics_vector.h"
#include "common/simulation/world/random_stream.h"
#include "server/solve/evaluate/uncertainty.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kRowsPurpose = 0x726f7773;
constexpr double kStep = 1e-6;  // of a numeric derivative, rad or m

Eigen::Vector3d CentreOf(const RigidTransform& cam_from_rig) {
  return cam_from_rig.SourceFromTargetTranslation();
}

// Moved by one of the six parameters of the joint covariance.
RigidTransform Moved(RigidTransform pose, int parameter) {
  const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(parameter % 3);
  if (parameter < 3) {
    pose.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(kStep, step.normalized())) * pose.rotation;
  } else {
    pose.translation_m += step;
  }
  return pose;
}

// Of the joint covariance: the first row of each camera's pose, -1 for the reference camera.
std::vector<int> PoseRows(const CalibrationResult& result, int* size) {
  std::vector<int> rows;
  *size = 0;
  for (const CalibratedCamera& camera : result.cameras) {
    const bool is_reference = camera.camera == result.reference_camera;
    rows.push_back(is_reference ? -1 : *size);
    *size += is_reference ? 0 : 6;
    if (camera.intrinsics_refined) *size += static_cast<int>(ToVector(camera.intrinsics).size());
  }
  return rows;
}

// In the form of CalibrationResult::camera_covariance; empty where something is not determined.
std::vector<double> NoiseCovariance(const server::RigSolution& solution) {
  absl::StatusOr<server::RigUncertainty> uncertainty = server::ComputeUncertainty(solution, {});
  if (!uncertainty.ok()) return {};
  uncertainty->covariance = uncertainty->noise_covariance;
  return server::PackCameraCovariance(solution.built.problem, 0, *uncertainty);
}

}  // namespace

void DropRowsOfAll(uint32_t seed, double share, server::CalibrationInput* input) {
  RandomStream random{seed, kRowsPurpose};
  for (server::CameraTrack& track : input->tracks) {
    std::erase_if(track.observations, [&](const Observation&) { return random.Uniform() < share; });
  }
}

std::vector<CameraDistance> CameraDistances(const CalibrationResult& result) {
  int size = 0;
  const std::vector<int> rows = PoseRows(result, &size);
  const std::vector<double>& packed = result.camera_covariance;
  const bool known = packed.size() == static_cast<size_t>(size * (size + 1) / 2);
  const auto covariance = [&packed](int i, int j) {
    const int low = std::max(i, j), high = std::min(i, j);
    return packed[static_cast<size_t>(low * (low + 1) / 2 + high)];
  };
  std::vector<CameraDistance> distances;
  for (size_t a = 0; a < result.cameras.size(); ++a) {
    for (size_t b = a + 1; b < result.cameras.size(); ++b) {
      const RigidTransform &pose_a = result.cameras[a].cam_from_rig,
                           &pose_b = result.cameras[b].cam_from_rig;
      CameraDistance distance;
      distance.distance_m = (CentreOf(pose_a) - CentreOf(pose_b)).norm();
      std::vector<std::pair<int, double>> gradient;  // by row of the covariance
      for (int k = 0; k < 6; ++k) {
        const double moved_a = (CentreOf(Moved(pose_a, k)) - CentreOf(pose_b)).norm();
        const double moved_b = (CentreOf(pose_a) - CentreOf(Moved(pose_b, k))).norm();
        if (rows[a] >= 0)
          gradient.push_back({rows[a] + k, (moved_a - distance.distance_m) / kStep});
        if (rows[b] >= 0)
          gradient.push_back({rows[b] + k, (moved_b - distance.distance_m) / kStep});
      }
      if (known) {
        const double scale_m = result.target.scale_sigma_rel * distance.distance_m;
        double variance = scale_m * scale_m;
        for (const auto& [i, by_i] : gradient) {
          for (const auto& [j, by_j] : gradient) variance += by_i * covariance(i, j) * by_j;
        }
        distance.sigma_m = std::sqrt(std::max(0.0, variance));
      }
      distances.push_back(distance);
    }
  }
  return distances;
}

SparseRun RunSparse(const server::CalibrationInput& input, const CalibrationResult& whole,
                    double share, uint32_t seed, const CalibrationOptions& options) {
  server::CalibrationInput sparse = input;
  DropRowsOfAll(seed, share, &sparse);
  SparseRun run;
  std::vector<double> noise;
  server::CalibrationHooks hooks;
  hooks.solved = [&](const server::RigObservations&, const server::RigSolution& solution) {
    noise = NoiseCovariance(solution);
  };
  const server::CalibrationOutcome outcome = server::Calibrate(std::move(sparse), options, hooks);
  run.status = outcome.result.status();
  if (!run.status.ok()) return run;
  run.grade = outcome.result->quality.grade;
  run.reasons = outcome.result->quality.reasons;
  for (const Finding& finding : outcome.result->findings) {
    run.reasons.push_back(std::string(NameOf(finding.kind)) + " " + finding.camera + ": " +
                          finding.advice);
  }
  run.instant_count = outcome.result->instant_count;
  const auto expected = CameraDistances(whole), found = CameraDistances(*outcome.result);
  for (size_t i = 0; i < found.size(); ++i) {
    const double error_m = std::abs(found[i].distance_m - expected[i].distance_m);
    run.worst_m = std::max(run.worst_m, error_m);
    run.worst_sigmas =
        std::max(run.worst_sigmas, found[i].sigma_m > 0 ? error_m / found[i].sigma_m : INFINITY);
  }
  // The wand, and with it what is not known about the scale, is the same in both.
  CalibrationResult by_noise = *outcome.result;
  by_noise.target.scale_sigma_rel = 0;
  const auto shape = CameraDistances(by_noise);
  for (size_t i = 0; i < found.size(); ++i) {
    const double error_m = std::abs(found[i].distance_m - expected[i].distance_m);
    run.worst_shape_sigmas = std::max(run.worst_shape_sigmas,
                                      shape[i].sigma_m > 0 ? error_m / shape[i].sigma_m : INFINITY);
  }
  by_noise.camera_covariance = std::move(noise);
  for (const CameraDistance& distance : CameraDistances(by_noise)) {
    run.noise_sigma_m = std::max(run.noise_sigma_m, distance.sigma_m);
  }
  return run;
}

}  // namespace rigcal::accuracy
