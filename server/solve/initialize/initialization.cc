// SPDX-License-Identifier: Apache-2.0
#include "server/solve/initialize/initialization.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/status/status_macros.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/geometry/marker_rays.h"
#include "server/solve/geometry/relative_pose.h"
#include "server/solve/geometry/target_pose.h"
#include "server/solve/initialize/overlap_graph.h"
#include "server/solve/initialize/point_chain.h"
#include "server/solve/initialize/rigid_pairs.h"
#include "server/solve/initialize/shared_views.h"

namespace rigcal::server {
namespace {

constexpr int kMinRigidShared = 3;    // each view of a rigid target gives a pose by itself
constexpr size_t kMaxInstants = 400;  // used while the cameras' poses are found

using Rays = std::vector<Eigen::Vector2d>;

double MeanFocalPx(const BundleCamera& camera) {
  return 0.5 * (camera.intrinsics[0] + camera.intrinsics[1]);
}

bool IsCancelled(const InitializationOptions& options) {
  return options.cancelled != nullptr && options.cancelled->load();
}

// The instants two cameras share, with the markers both show.
std::vector<PairInstant> SharedInstants(const BundleProblem& problem, const Rays& rays, int a,
                                        int b) {
  std::vector<PairInstant> shared;
  for (const BundleInstant& instant : problem.instants) {
    if (instant.is_rigid) continue;
    const BundleObservation* const left = ObservationBy(problem, instant, a);
    const BundleObservation* const right = ObservationBy(problem, instant, b);
    if (left == nullptr || right == nullptr) continue;
    PairInstant pair;
    for (const BundleMarker& in_left : problem.MarkersOf(*left)) {
      const Eigen::Vector2d& left_ray = rays[problem.IndexOf(in_left)];
      for (const BundleMarker& in_right : problem.MarkersOf(*right)) {
        const Eigen::Vector2d& right_ray = rays[problem.IndexOf(in_right)];
        if (in_left.marker == in_right.marker && in_left.used && in_right.used &&
            left_ray.allFinite() && right_ray.allFinite()) {
          pair.push_back({in_left.marker, left_ray, right_ray});
        }
      }
    }
    if (!pair.empty()) shared.push_back(std::move(pair));
  }
  return shared;
}

OverlapGraph MakeGraph(const BundleProblem& problem, const InitializationOptions& options) {
  OverlapGraph graph;
  graph.notes = options.camera_notes;
  if (problem.HasBody()) graph.min_shared = kMinRigidShared;
  graph.avoided = options.avoided_pairs;
  graph.describe = [&problem](int a, int b) { return DescribeSharedViews(problem, a, b); };
  graph.shared_counts =
      CountShared(problem, [](const BundleInstant& instant, const BundleObservation&) {
        return !instant.is_point;  // beside another target: no pose comes from it
      });
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    graph.cameras.push_back(problem.cameras[c].name);
    graph.view_counts.push_back(graph.shared_counts[c][c]);
  }
  return graph;
}

std::optional<RelativePose> EstimateLinePairPose(const InitializationOptions& options,
                                                 const Rays& rays, const BundleProblem& problem,
                                                 int a, int b, int rank) {
  RelativePoseOptions pair;
  pair.marker_positions_m = problem.target.marker_positions_m;
  pair.focal_a_px = MeanFocalPx(problem.cameras[static_cast<size_t>(a)]);
  pair.focal_b_px = MeanFocalPx(problem.cameras[static_cast<size_t>(b)]);
  pair.threshold_px = kAgreePx;
  // The pair's own seed, so that looking at one pair more changes no other.
  pair.seed = options.seed + static_cast<uint32_t>(a) * 65537u + static_cast<uint32_t>(b);
  pair.rank = rank;
  return EstimateRelativePose(SharedInstants(problem, rays, a, b), pair);
}

double AgreeingShare(const RelativePose& pose) {
  return static_cast<double>(pose.inlier_count) / std::max(1, pose.instant_count);
}

// By the kind of target that says more clearly how the two cameras stand.
std::optional<RelativePose> EstimateMixedPairPose(const InitializationOptions& options,
                                                  const Rays& rays, const BundleProblem& problem,
                                                  int a, int b, int rank) {
  const auto rigid =
      EstimateRigidPairPose(problem, rays, a, b, {.threshold_px = kAgreePx, .rank = rank});
  const auto line = EstimateLinePairPose(options, rays, problem, a, b, rank);
  if (!line || line->inlier_count < OverlapGraph().min_shared) return rigid;
  return rigid && AgreeingShare(*rigid) >= AgreeingShare(*line) ? rigid : line;
}

// What is referred to must outlive it. a < b.
PairEstimate MakePairEstimate(const InitializationOptions& options, const Rays& rays,
                              const BundleProblem& problem) {
  return [&options, &rays, &problem, looked_at = 0](
             int a, int b) mutable -> absl::StatusOr<std::optional<RelativePose>> {
    if (IsCancelled(options)) return absl::CancelledError("the calibration was cancelled");
    if (options.progress) {
      ++looked_at;
      const double cameras = static_cast<double>(problem.cameras.size());
      options.progress(0.8 * looked_at / (looked_at + cameras));
    }
    const int rank =
        static_cast<int>(std::ranges::count(options.avoided_pairs, std::make_pair(a, b)));
    if (!problem.HasBody()) return EstimateLinePairPose(options, rays, problem, a, b, rank);
    return EstimateMixedPairPose(options, rays, problem, a, b, rank);
  };
}

// Walks the tree from the fixed camera.
void ChainPoses(const std::vector<OverlapEdge>& edges, BundleProblem* problem) {
  std::vector<bool> done(problem->cameras.size(), false);
  for (size_t c = 0; c < problem->cameras.size(); ++c) done[c] = problem->cameras[c].pose_fixed;
  for (size_t round = 0; round < edges.size(); ++round) {
    for (const OverlapEdge& edge : edges) {
      const auto a = static_cast<size_t>(edge.a), b = static_cast<size_t>(edge.b);
      if (done[a] == done[b]) continue;
      RigidTransform& pose_a = problem->cameras[a].cam_from_rig;
      RigidTransform& pose_b = problem->cameras[b].cam_from_rig;
      if (done[a]) {
        pose_b = edge.pose.b_from_a * pose_a;
      } else {
        pose_a = edge.pose.b_from_a.Inverse() * pose_b;
      }
      done[a] = done[b] = true;
    }
  }
}

// How an instant's used markers fit its pose.
struct InstantFit {
  double cost = 0;     // the one that an adjustment lowers, else the two would undo each other
  bool seen = true;    // by their cameras: one that is not would stop the bundle adjustment
  bool agrees = true;  // all are within the threshold
};

InstantFit FitOf(const BundleProblem& problem, const BundleInstant& instant, double threshold_px) {
  const double scale = BundleOptions().loss_scale;
  InstantFit fit;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      if (!marker.used) continue;
      const auto residual = MarkerResidualPx(problem, instant, observation, marker);
      fit.seen = fit.seen && residual;
      fit.agrees = fit.agrees && residual && residual->norm() < threshold_px;
      if (!residual) continue;
      fit.cost += std::log1p((marker.sqrt_information * *residual).squaredNorm() / (scale * scale));
    }
  }
  return fit;
}

// Looks at so many instants, evenly chosen. `known_rays`: of all markers; null: of those that are
// needed, made here.
int PlaceSome(double threshold_px, size_t count, const Rays* known_rays, BundleProblem* problem) {
  Rays own_rays(known_rays == nullptr ? problem->markers.size() : 0);
  const Rays& rays = known_rays == nullptr ? own_rays : *known_rays;
  const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(*problem);
  const std::vector<bool> has_pose(problem->cameras.size(), true);
  int placed = 0;
  const size_t all = problem->instants.size();
  count = std::min(count, all);
  for (size_t i = 0; i < count; ++i) {
    BundleInstant& instant = problem->instants[i * all / count];
    const InstantFit old = FitOf(*problem, instant, threshold_px);
    const bool agrees = instant.used && old.agrees;
    instant.used = instant.used && old.seen;
    if (!agrees) {
      if (known_rays == nullptr) UndistortInstant(*problem, intrinsics, instant, &own_rays);
      const auto found = EstimateTargetPose(*problem, has_pose, rays, 2 * threshold_px, instant);
      const InstantFit fit = found ? FitOf(*problem, found->instant, threshold_px) : InstantFit{};
      if (found && fit.seen && (!instant.used || fit.cost < old.cost)) {
        instant = found->instant;
        instant.used = true;
      }
    }
    placed += instant.used ? 1 : 0;
  }
  return placed;
}

absl::Status SettlePoses(const InitializationOptions& options, BundleProblem* problem) {
  BundleOptions bundle;
  bundle.loss_scale = kAgreePx;
  bundle.max_iterations = 30;
  bundle.function_tolerance = 1e-5;
  bundle.cancelled = options.cancelled;
  return AdjustBundle(bundle, problem).status();
}

}  // namespace

int PlaceInstants(double threshold_px, BundleProblem* problem) {
  return PlaceSome(threshold_px, problem->instants.size(), nullptr, problem);
}

absl::Status FindInitialization(const InitializationOptions& options, BundleProblem* problem,
                                std::vector<std::pair<int, int>>* tree) {
  const Rays rays = UndistortMarkers(*problem);
  const PairEstimate estimate = MakePairEstimate(options, rays, *problem);
  const OverlapGraph graph = MakeGraph(*problem, options);
  if (problem->IsPoint()) {
    RIGCAL_RETURN_IF_ERROR(ChainPointPoses(graph, rays, estimate, problem));
  } else {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<OverlapEdge> edges,
                            FindSpanningTree(graph, estimate));
    ChainPoses(edges, problem);
    if (tree != nullptr) {
      tree->clear();
      for (const OverlapEdge& edge : edges) tree->emplace_back(edge.a, edge.b);
    }
  }
  for (BundleInstant& instant : problem->instants) instant.used = false;
  for (int round = 0; round < 2; ++round) {
    // Poses that were chained over several pairs are coarse: the first round is generous.
    const double threshold_px = round == 0 ? 4 * kAgreePx : kAgreePx;
    if (IsCancelled(options)) return absl::CancelledError("the calibration was cancelled");
    if (PlaceSome(threshold_px, kMaxInstants, &rays, problem) == 0) {
      return absl::FailedPreconditionError(
          "no instant of the target can be placed from two cameras: check the target's marker "
          "positions and the cameras' intrinsics. " +
          DescribeLostCameras(*problem, 1));
    }
    RIGCAL_RETURN_IF_ERROR(SettlePoses(options, problem));
    if (options.progress) options.progress(0.8 + 0.1 * (round + 1));
  }
  PlaceSome(kAgreePx, problem->instants.size(), &rays, problem);
  return absl::OkStatus();
}

}  // namespace rigcal::server
