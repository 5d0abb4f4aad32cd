// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/predicted_error.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/complement.hpp>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "common/statistics/robust_statistics.h"
#include "server/solve/evaluate/attached_point.h"
#include "server/solve/evaluate/scale_uncertainty.h"

namespace rigcal::server {
namespace {

constexpr double kAcceptedShare = 0.01;  // of the distance
constexpr int64_t kBlockNs = 2'000'000'000;
constexpr int kMinInstantsOfBlock = 4;
constexpr size_t kMinFolds = 3;
constexpr double kFoldChance = 0.001;
constexpr double kLeastShare = 0.02, kMostShare = 0.98;  // of the views, in a fold

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

// By camera: the blocks in which it takes part.
std::vector<int> CountCameraBlocks(const BuiltProblem& built) {
  std::vector<std::set<int64_t>> blocks(built.problem.cameras.size());
  for (size_t i = 0; i < built.problem.instants.size(); ++i) {
    ForEachUsedMarker(built.problem, built.problem.instants[i],
                      [&](const BundleObservation& observation, const BundleMarker&) {
                        blocks[static_cast<size_t>(observation.camera)].insert(
                            built.instant_time_ns[i] / kBlockNs);
                      });
  }
  std::vector<int> counts;
  for (const std::set<int64_t>& own : blocks) counts.push_back(static_cast<int>(own.size()));
  return counts;
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

// Views that are part of an instant, by camera.
std::vector<double> CountViews(const RigIndex& index, const RigSolution& solution) {
  std::vector<double> counts(solution.built.problem.cameras.size());
  for (const Instant& instant : solution.instants.instants) {
    for (const InstantMember& member : instant.members) {
      ++counts[static_cast<size_t>(index.camera_of_track[static_cast<size_t>(member.track)])];
    }
  }
  return counts;
}

bool HasLensesOf(const FoldPoses& fold, const BundleProblem& problem) {
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    if (fold.intrinsics_fixed[c] != problem.cameras[c].intrinsics_fixed) return false;
  }
  return true;
}

// The shape as independent errors alone would have it.
RigUncertainty NoiseOf(const BundleProblem& problem, const RigUncertainty& uncertainty) {
  if (uncertainty.noise_covariance.rows() != uncertainty.covariance.rows()) return uncertainty;
  RigUncertainty noise;
  noise.parameters = uncertainty.parameters;
  noise.covariance = uncertainty.noise_covariance;
  DescribeScale(problem, 0, &noise);
  return noise;
}

// Of the camera centres. `covariance` of them.
FoldScatter MeasureScatter(const BundleProblem& problem, const RigUncertainty& uncertainty,
                           const Eigen::MatrixXd& covariance, const std::vector<FoldPoses>& folds,
                           const Eigen::Vector3d& middle_m) {
  const std::vector<double> sigmas_m = CentreSigmas(covariance);
  const std::vector<double> noises_m =
      FrameFreeCentreSigmas(problem, NoiseOf(problem, uncertainty), middle_m);
  const std::vector<RigidTransform> cam_from_rig = PosesOf(problem);
  FoldScatter scatter;
  size_t count = 0;
  for (const FoldPoses& fold : folds) {
    if (!HasLensesOf(fold, problem)) continue;
    ++count;
    const double left_out = std::clamp(fold.left_out, kLeastShare, kMostShare);
    const std::vector<double> distances_m =
        FrameFreeCentreDistances(cam_from_rig, fold.cam_from_rig, middle_m);
    for (size_t c = 0; c < distances_m.size(); ++c) {
      const double share = std::clamp(fold.view_shares[c], kLeastShare, kMostShare);
      const double noise_m2 = noises_m[c] * noises_m[c];
      scatter.squares_m2 += distances_m[c] * distances_m[c];
      scatter.expected_m2 +=
          (1 - share) / share * noise_m2 +
          left_out / (1 - left_out) * std::max(0.0, sigmas_m[c] * sigmas_m[c] - noise_m2);
    }
  }
  const double trace = covariance.trace();
  if (count < kMinFolds || !(trace > 0)) return {};
  scatter.degrees_of_freedom =
      static_cast<double>(count - 1) * trace * trace / covariance.squaredNorm();
  return scatter;
}

}  // namespace

Eigen::Vector3d MiddleOfWave(const BundleProblem& problem) {
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

FoldPoses FoldPosesOf(const RigIndex& index, const RigSolution& fold, const RigSolution& all) {
  FoldPoses poses;
  for (const BundleCamera& camera : fold.built.problem.cameras) {
    poses.cam_from_rig.push_back(camera.cam_from_rig);
    poses.intrinsics_fixed.push_back(camera.intrinsics_fixed);
  }
  const std::vector<double> solved = CountViews(index, fold), views = CountViews(index, all);
  for (size_t c = 0; c < views.size(); ++c) {
    poses.view_shares.push_back(solved[c] / std::max(1.0, views[c]));
  }
  return poses;
}

double FoldScatter::Factor() const {
  if (!(degrees_of_freedom > 0) || !(expected_m2 > 0)) return 1;
  const double ratio = squares_m2 / expected_m2;
  const boost::math::chi_squared distribution(degrees_of_freedom);
  const double by_chance =
      boost::math::quantile(boost::math::complement(distribution, kFoldChance)) /
      degrees_of_freedom;
  return ratio > by_chance ? std::sqrt(ratio) : 1;
}

PredictedError PredictError(const RigSolution& solution,
                            const std::optional<RigUncertainty>& uncertainty,
                            const KeptLenses& lenses, const std::vector<FoldPoses>& folds,
                            double accept_m) {
  const BundleProblem& problem = solution.built.problem;
  const Eigen::Vector3d middle_m = MiddleOfWave(problem);
  PredictedError error;
  error.distance_m = MedianDistanceM(problem, middle_m);
  error.accepted_m = accept_m > 0 ? accept_m : kAcceptedShare * error.distance_m;
  error.instant_count = UsedInstants(problem);
  error.block_count = CountBlocks(solution.built);
  const std::vector<int> of_cameras = CountCameraBlocks(solution.built);
  const auto scarcest = std::ranges::min_element(of_cameras);
  error.scarcest_block_count = *scarcest;
  error.scarcest_camera = problem.cameras[static_cast<size_t>(scarcest - of_cameras.begin())].name;
  error.fold_count = static_cast<int>(folds.size());
  error.holds = error.scarcest_block_count >= kMinCameraBlocks && uncertainty &&
                error.block_count >= kMinPredictedBlocks &&
                error.instant_count >= kMinPredictedInstants && folds.size() >= kMinFolds;
  if (!uncertainty) {
    error.sigma_m = error.stated_m = std::numeric_limits<double>::infinity();
    return error;
  }
  const Eigen::MatrixXd covariance = FrameFreeCentreCovariance(problem, *uncertainty, middle_m);
  error.stated_m = Largest(CentreSigmas(covariance));
  error.fold_factor = MeasureScatter(problem, *uncertainty, covariance, folds, middle_m).Factor();
  const double with_lenses_m = Largest(PredictCentreSigmas(problem, *uncertainty, lenses, 1));
  error.by_lenses_m =
      std::sqrt(std::max(0.0, std::pow(with_lenses_m, 2) - std::pow(error.stated_m, 2)));
  error.sigma_m = Largest(PredictCentreSigmas(problem, *uncertainty, lenses, error.fold_factor));
  return error;
}

double AllTogether(double by_covariance, double with_lenses, double fold_factor) {
  const double by_lenses = std::max(0.0, with_lenses * with_lenses - by_covariance * by_covariance);
  return std::sqrt(std::pow(fold_factor * by_covariance, 2) + by_lenses);
}

std::vector<double> PredictCentreSigmas(const BundleProblem& problem,
                                        const RigUncertainty& uncertainty, const KeptLenses& lenses,
                                        double fold_factor) {
  const Eigen::Vector3d middle_m = MiddleOfWave(problem);
  std::vector<double> sigmas_m = FrameFreeCentreSigmas(problem, uncertainty, middle_m);
  const std::vector<double> with_lenses_m =
      FrameFreeCentreSigmas(problem, WithKeptLenses(uncertainty, lenses), middle_m);
  for (size_t c = 0; c < sigmas_m.size(); ++c) {
    sigmas_m[c] = AllTogether(sigmas_m[c], with_lenses_m[c], fold_factor);
  }
  return sigmas_m;
}

}  // namespace rigcal::server
