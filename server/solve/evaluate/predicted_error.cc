// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/predicted_error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "common/statistics/robust_statistics.h"
#include "server/solve/evaluate/attached_point.h"

namespace rigcal::server {
namespace {

constexpr double kAcceptedShare = 0.01;  // of the distance
constexpr int64_t kBlockNs = 2'000'000'000;
constexpr int kMinInstantsOfBlock = 4;
constexpr size_t kMinFolds = 3;

int UsedInstants(const BundleProblem& problem) {
  return static_cast<int>(std::ranges::count(problem.instants, true, &BundleInstant::used));
}

int CountBlocks(const BuiltProblem& built) {
  std::map<int64_t, int> counts;
  for (size_t i = 0; i < built.problem.instants.size(); ++i) {
    if (built.problem.instants[i].used) ++counts[built.instant_time_ns[i] / kBlockNs];
  }
  return static_cast<int>(std::ranges::count_if(
      counts, [](const auto& entry) { return entry.second >= kMinInstantsOfBlock; }));
}

// Of the waved volume.
Eigen::Vector3d MiddleM(const BundleProblem& problem) {
  std::vector<double> coordinates[3];
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (int i = 0; i < 3; ++i) coordinates[i].push_back(instant.origin_m[i]);
  }
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  if (coordinates[0].empty()) return middle_m;
  for (int i = 0; i < 3; ++i) middle_m[i] = UpperMedian(&coordinates[i]);
  return middle_m;
}

double MedianDistanceM(const BundleProblem& problem, const Eigen::Vector3d& middle_m) {
  std::vector<double> distances_m;
  for (const BundleCamera& camera : problem.cameras) {
    distances_m.push_back((camera.cam_from_rig.SourceFromTargetTranslation() - middle_m).norm());
  }
  return Median(distances_m);
}

std::vector<RigidTransform> PosesOf(const BundleProblem& problem) {
  std::vector<RigidTransform> cam_from_rig;
  for (const BundleCamera& camera : problem.cameras) cam_from_rig.push_back(camera.cam_from_rig);
  return cam_from_rig;
}

double Largest(const std::vector<double>& values) {
  return values.empty() ? 0 : std::ranges::max(values);
}

}  // namespace

FoldPoses FoldPosesOf(const RigSolution& fold, int all_instants) {
  return {PosesOf(fold.built.problem),
          1 - static_cast<double>(UsedInstants(fold.built.problem)) / std::max(1, all_instants)};
}

PredictedError PredictError(const RigSolution& solution,
                            const std::optional<RigUncertainty>& uncertainty,
                            const std::vector<FoldPoses>& folds, const FoldPoses* refined,
                            double accept_m) {
  const BundleProblem& problem = solution.built.problem;
  const Eigen::Vector3d middle_m = MiddleM(problem);
  const std::vector<RigidTransform> cam_from_rig = PosesOf(problem);
  PredictedError error;
  error.distance_m = MedianDistanceM(problem, middle_m);
  error.accepted_m = accept_m > 0 ? accept_m : kAcceptedShare * error.distance_m;
  error.instant_count = UsedInstants(problem);
  error.block_count = CountBlocks(solution.built);
  error.fold_count = static_cast<int>(folds.size());
  error.stated_m = uncertainty ? Largest(FrameFreeCentreSigmas(problem, *uncertainty, middle_m))
                               : std::numeric_limits<double>::infinity();
  if (folds.size() >= kMinFolds) {
    std::vector<double> squares_m2(cam_from_rig.size());
    for (const FoldPoses& fold : folds) {
      const double left_out = std::clamp(fold.left_out, 0.05, 0.95);
      const std::vector<double> distances_m =
          FrameFreeCentreDistances(cam_from_rig, fold.cam_from_rig, middle_m);
      for (size_t c = 0; c < distances_m.size(); ++c) {
        squares_m2[c] += (1 - left_out) / left_out * distances_m[c] * distances_m[c];
      }
    }
    error.by_folds_m = std::sqrt(Largest(squares_m2) / static_cast<double>(folds.size()));
  }
  if (refined != nullptr) {
    error.by_intrinsics_m =
        Largest(FrameFreeCentreDistances(cam_from_rig, refined->cam_from_rig, middle_m));
  }
  error.sigma_m = std::max({error.stated_m, error.by_folds_m, error.by_intrinsics_m});
  error.holds = uncertainty && error.block_count >= kMinPredictedBlocks &&
                error.instant_count >= kMinPredictedInstants && folds.size() >= kMinFolds;
  return error;
}

}  // namespace rigcal::server
