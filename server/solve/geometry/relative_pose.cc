// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/relative_pose.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/geometry/essential_matrix.h"
#include "server/solve/geometry/marker_rays.h"
#include "server/solve/geometry/target_pose.h"
#include "server/solve/geometry/triangulation.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxInstants = 200;
constexpr int kMinInlierInstants = 8;
constexpr size_t kRefinedPoses = 3;
constexpr double kSamePoseRad = 0.1;  // between rotations, and between directions of the baseline
constexpr double kConvincingShare = 0.7;
constexpr double kMaxLogScale = 0.35;  // how far one instant's size may be from the median's

bool IsPoint(const RelativePoseOptions& options) { return options.marker_positions_m.size() < 2; }

struct ScoredPose {
  double cost = std::numeric_limits<double>::infinity();
  RigidTransform b_from_a;
};

std::vector<PairInstant> EvenlyChosen(const std::vector<PairInstant>& instants) {
  const size_t count = std::min(instants.size(), kMaxInstants);
  std::vector<PairInstant> chosen;
  for (size_t i = 0; i < count; ++i) chosen.push_back(instants[i * instants.size() / count]);
  return chosen;
}

// What one instant says about a pose with a baseline of unit length: how far it is from agreeing
// with it (0 to 1), and the scale that gives the target its size. No scale: it disagrees, or shows
// one marker only.
struct InstantVerdict {
  double reprojection = 1;  // squared share of the threshold, at most 1
  std::optional<double> log_scale;
};

InstantVerdict ScoreInstant(const PairInstant& instant, const RigidTransform& b_from_a,
                            const RelativePoseOptions& options) {
  InstantVerdict verdict;
  std::vector<std::pair<double, Eigen::Vector3d>> points;
  double sum = 0;
  for (const PairMarker& marker : instant) {
    const CameraRay a = {RigidTransform::Identity(), marker.ray_a}, b = {b_from_a, marker.ray_b};
    const auto point = TriangulatePair(a, b);
    const double error = point ? std::max(options.focal_a_px * RayError(a, *point),
                                          options.focal_b_px * RayError(b, *point))
                               : options.threshold_px;
    sum += std::min(1.0, error * error / (options.threshold_px * options.threshold_px));
    if (error < options.threshold_px) {
      points.emplace_back(options.marker_positions_m[static_cast<size_t>(marker.marker)], *point);
    }
  }
  verdict.reprojection = sum / static_cast<double>(instant.size());
  if (points.size() == instant.size() && points.size() >= 2) {
    const double span_m = std::abs(points.back().first - points.front().first);
    const double length = (points.back().second - points.front().second).norm();
    if (length > 0 && span_m > 0) verdict.log_scale = std::log(span_m / length);
  }
  return verdict;
}

ScoredPose ScorePose(const std::vector<PairInstant>& instants, const RigidTransform& unit_pose,
                     const RelativePoseOptions& options) {
  std::vector<InstantVerdict> verdicts;
  std::vector<double> log_scales;
  for (const PairInstant& instant : instants) {
    verdicts.push_back(ScoreInstant(instant, unit_pose, options));
    if (verdicts.back().log_scale) log_scales.push_back(*verdicts.back().log_scale);
  }
  ScoredPose scored;
  if (IsPoint(options)) {
    scored.cost = 0;
    for (const InstantVerdict& verdict : verdicts) scored.cost += verdict.reprojection;
    scored.b_from_a = unit_pose;
    return scored;
  }
  if (log_scales.empty()) return scored;
  const double middle = UpperMedian(&log_scales);
  scored.cost = 0;
  for (const InstantVerdict& verdict : verdicts) {
    double deviation = 1;
    if (verdict.log_scale) {
      deviation = std::min(1.0, std::abs(*verdict.log_scale - middle) / kMaxLogScale);
    }
    scored.cost += 0.5 * verdict.reprojection + 0.5 * deviation * deviation;
  }
  scored.b_from_a = {unit_pose.rotation, unit_pose.translation_m * std::exp(middle)};
  return scored;
}

// Two cameras without distortion and the rigid target, as a bundle adjustment.
BundleProblem PairProblem(const std::vector<PairInstant>& instants,
                          const RelativePoseOptions& options) {
  BundleProblem problem;
  problem.clocks.resize(1);
  problem.target.marker_positions_m = options.marker_positions_m;
  if (IsPoint(options)) problem.distance = BundleDistance{0, 1, 1};
  for (const double focal_px : {options.focal_a_px, options.focal_b_px}) {
    BundleCamera camera;
    camera.name = problem.cameras.empty() ? "a" : "b";
    camera.pose_fixed = problem.cameras.empty();
    camera.intrinsics = IntrinsicsVector::Zero(9);
    camera.intrinsics[0] = camera.intrinsics[1] = focal_px;
    problem.cameras.push_back(camera);
  }
  for (const PairInstant& pair : instants) {
    BundleInstant instant;
    instant.first_observation = static_cast<int>(problem.observations.size());
    instant.observation_count = 2;
    for (int c = 0; c < 2; ++c) {
      problem.observations.push_back(
          {c, 0, 0, static_cast<int>(problem.markers.size()), static_cast<int>(pair.size())});
      for (const PairMarker& marker : pair) {
        BundleMarker entry;
        entry.marker = marker.marker;
        entry.centre_px =
            c == 0 ? marker.ray_a * options.focal_a_px : marker.ray_b * options.focal_b_px;
        problem.markers.push_back(entry);
      }
    }
    problem.instants.push_back(instant);
  }
  return problem;
}

std::optional<RelativePose> RefineWithTarget(const std::vector<PairInstant>& instants,
                                             const RigidTransform& b_from_a,
                                             const RelativePoseOptions& options) {
  BundleProblem problem = PairProblem(instants, options);
  const std::vector<Eigen::Vector2d> rays = UndistortMarkers(problem);
  problem.cameras[1].cam_from_rig = b_from_a;
  const std::vector<bool> has_pose(2, true);
  RelativePose result;
  result.instant_count = static_cast<int>(instants.size());
  for (int round = 0; round < 2; ++round) {
    int used = 0;
    for (BundleInstant& instant : problem.instants) {
      if (round > 0 && instant.used) {  // the adjustment has placed it
        ++used;
        continue;
      }
      const auto fit =
          EstimateTargetPose(problem, has_pose, rays, 2 * options.threshold_px, instant);
      if (fit) instant = fit->instant;
      instant.used = fit && fit->inliers * 2 > fit->markers;
      used += instant.used ? 1 : 0;
    }
    if (used < kMinInlierInstants) return std::nullopt;
    BundleOptions bundle;
    bundle.loss_scale = options.threshold_px / 2;
    bundle.max_iterations = 30;
    bundle.function_tolerance = 1e-6;
    if (!SolveLineBundle(bundle, &problem).ok()) return std::nullopt;
  }
  std::vector<double> errors;
  for (const BundleInstant& instant : problem.instants) {
    double worst = 0;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        const auto residual = MarkerResidualPx(problem, instant, observation, marker);
        const bool seen = instant.used && residual;
        errors.push_back(seen ? residual->norm() : std::numeric_limits<double>::infinity());
        worst = std::max(worst, errors.back());
      }
    }
    result.inlier_count += worst < options.threshold_px ? 1 : 0;
  }
  if (result.inlier_count < kMinInlierInstants) return std::nullopt;
  result.median_px = UpperMedian(&errors);
  result.b_from_a = problem.cameras[1].cam_from_rig;
  if (IsPoint(options)) result.b_from_a.translation_m.normalize();
  return result;
}

bool IsSamePose(const RigidTransform& a, const RigidTransform& b) {
  const double cosine =
      a.translation_m.normalized().dot(b.translation_m.normalized());  // 0 where one is zero
  return a.rotation.angularDistance(b.rotation) < kSamePoseRad && cosine > std::cos(kSamePoseRad);
}

bool IsBetter(const RelativePose& a, const RelativePose& b) {
  return a.inlier_count > b.inlier_count ||
         (a.inlier_count == b.inlier_count && a.median_px < b.median_px);
}

// The pose of this rank among those that differ, best first.
std::optional<RelativePose> RankedPose(const std::vector<PairInstant>& instants,
                                       const std::vector<ScoredPose>& poses,
                                       const RelativePoseOptions& options) {
  const size_t rank = static_cast<size_t>(options.rank);
  std::vector<RigidTransform> starts;
  std::vector<RelativePose> found;
  for (const ScoredPose& pose : poses) {
    if (starts.size() == kRefinedPoses * (rank + 1)) break;
    const auto same = [](const RigidTransform& a) {
      return [&a](const RigidTransform& b) { return IsSamePose(a, b); };
    };
    if (std::ranges::any_of(starts, same(pose.b_from_a))) continue;
    starts.push_back(pose.b_from_a);
    const std::optional<RelativePose> refined = RefineWithTarget(instants, pose.b_from_a, options);
    if (!refined) continue;
    const auto known =
        std::ranges::find_if(found, same(refined->b_from_a), &RelativePose::b_from_a);
    if (known == found.end()) {
      found.push_back(*refined);
    } else if (IsBetter(*refined, *known)) {
      *known = *refined;
    }
  }
  if (found.empty()) return std::nullopt;
  std::stable_sort(found.begin(), found.end(), IsBetter);
  return found[std::min(rank, found.size() - 1)];
}

}  // namespace

std::optional<RelativePose> EstimateRelativePose(const std::vector<PairInstant>& all,
                                                 const RelativePoseOptions& options) {
  const std::vector<PairInstant> instants = EvenlyChosen(all);
  if (static_cast<int>(instants.size()) < kMinInlierInstants) return std::nullopt;
  std::vector<ScoredPose> poses;
  for (const Eigen::Matrix3d& essential : SampleEssentials(instants, options)) {
    for (const RigidTransform& pose : DecomposeEssential(essential)) {
      const ScoredPose scored = ScorePose(instants, pose, options);
      if (std::isfinite(scored.cost)) poses.push_back(scored);
    }
  }
  std::ranges::stable_sort(poses, {}, &ScoredPose::cost);
  if (options.rank > 0) return RankedPose(instants, poses, options);
  if (poses.size() > kRefinedPoses) poses.resize(kRefinedPoses);
  std::optional<RelativePose> best;
  for (const ScoredPose& pose : poses) {
    const std::optional<RelativePose> refined = RefineWithTarget(instants, pose.b_from_a, options);
    if (!refined) continue;
    if (!best || IsBetter(*refined, *best)) best = refined;
    // A wrong solution does not agree with so many.
    if (best->inlier_count > kConvincingShare * best->instant_count &&
        best->median_px < options.threshold_px / 3) {
      break;
    }
  }
  return best;
}

}  // namespace rigcal::server
