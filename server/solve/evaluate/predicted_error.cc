// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/predicted_error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr double kAcceptedShare = 0.01;  // of the distance
constexpr int64_t kBlockNs = 2'000'000'000;
constexpr int kMinInstantsOfBlock = 4;
constexpr int kMinBlocks = 4;
constexpr int kMinInstants = 60;
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

double MedianDistanceM(const BundleProblem& problem) {
  std::vector<double> coordinates[3];
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (int i = 0; i < 3; ++i) coordinates[i].push_back(instant.origin_m[i]);
  }
  if (coordinates[0].empty()) return 0;
  Eigen::Vector3d middle_m;
  for (int i = 0; i < 3; ++i) middle_m[i] = UpperMedian(&coordinates[i]);
  std::vector<double> distances_m;
  for (const BundleCamera& camera : problem.cameras) {
    distances_m.push_back((camera.cam_from_rig.SourceFromTargetTranslation() - middle_m).norm());
  }
  return Median(distances_m);
}

// Root of the mean over the cameras but the reference of what `square_m2(camera)` gives.
template <typename Square>
double RootMean(size_t cameras, int reference, Square square_m2) {
  double sum_m2 = 0;
  for (size_t c = 0; c < cameras; ++c) {
    if (static_cast<int>(c) != reference) sum_m2 += square_m2(c);
  }
  return std::sqrt(sum_m2 / static_cast<double>(std::max<size_t>(1, cameras - 1)));
}

}  // namespace

FoldPoses FoldPosesOf(const RigSolution& fold, int all_instants) {
  FoldPoses poses;
  for (const BundleCamera& camera : fold.built.problem.cameras) {
    poses.centres_m.push_back(camera.cam_from_rig.SourceFromTargetTranslation());
  }
  poses.left_out =
      1 - static_cast<double>(UsedInstants(fold.built.problem)) / std::max(1, all_instants);
  return poses;
}

PredictedError PredictError(const RigSolution& solution, const RigSolveOptions& options,
                            const std::optional<RigUncertainty>& uncertainty,
                            const std::vector<FoldPoses>& folds, const FoldPoses* refined,
                            double accept_m) {
  const BundleProblem& problem = solution.built.problem;
  PredictedError error;
  error.distance_m = MedianDistanceM(problem);
  error.accepted_m = accept_m > 0 ? accept_m : kAcceptedShare * error.distance_m;
  error.instant_count = UsedInstants(problem);
  error.block_count = CountBlocks(solution.built);
  error.fold_count = static_cast<int>(folds.size());
  const size_t count = problem.cameras.size();
  const auto centre_m = [&problem](size_t c) {
    return problem.cameras[c].cam_from_rig.SourceFromTargetTranslation();
  };
  error.stated_m = std::numeric_limits<double>::infinity();
  if (uncertainty) {
    error.stated_m = RootMean(count, options.reference_camera, [&](size_t c) {
      return uncertainty->cameras[c].position_sigma_m.squaredNorm();
    });
  }
  if (folds.size() >= kMinFolds) {
    error.by_folds_m = RootMean(count, options.reference_camera, [&](size_t c) {
      double sum_m2 = 0;
      for (const FoldPoses& fold : folds) {
        const double left_out = std::clamp(fold.left_out, 0.05, 0.95);
        sum_m2 += (1 - left_out) / left_out * (fold.centres_m[c] - centre_m(c)).squaredNorm();
      }
      return sum_m2 / static_cast<double>(folds.size());
    });
  }
  if (refined != nullptr) {
    error.by_intrinsics_m = RootMean(count, options.reference_camera, [&](size_t c) {
      return (refined->centres_m[c] - centre_m(c)).squaredNorm();
    });
  }
  error.sigma_m = std::max({error.stated_m, error.by_folds_m, error.by_intrinsics_m});
  error.holds = uncertainty && error.block_count >= kMinBlocks &&
                error.instant_count >= kMinInstants && folds.size() >= kMinFolds;
  return error;
}

}  // namespace rigcal::server
