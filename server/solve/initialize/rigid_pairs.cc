// SPDX-License-Identifier: Apache-2.0
#include "server/solve/initialize/rigid_pairs.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/geometry/marker_rays.h"
#include "server/solve/geometry/rigid_pose.h"
#include "server/solve/geometry/target_pose.h"
#include "server/solve/initialize/shared_views.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxPairViews = 60;
constexpr int kMinAgreeing = 3;    // instants
constexpr double kFarPx = 60;      // errors of a hypothesis count as at most this much
constexpr size_t kMaxRefined = 4;  // hypotheses
constexpr double kSameRad = 0.05;  // of poses that are one, and of their baselines' directions
constexpr double kInfinite = std::numeric_limits<double>::infinity();

// What two cameras see of the target at one instant.
struct PairView {
  const BundleObservation* in_a;
  const BundleObservation* in_b;
  std::vector<RigidTransform> a_from_target, b_from_target;
};

struct Hypothesis {
  RigidTransform b_from_a;
  double cost = kInfinite;
};

std::vector<PairView> PairViews(const BundleProblem& problem,
                                const std::vector<Eigen::Vector2d>& rays, int a, int b) {
  std::vector<PairView> all;
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.is_rigid || instant.is_point) continue;
    const BundleObservation* const in_a = ObservationBy(problem, instant, a);
    const BundleObservation* const in_b = ObservationBy(problem, instant, b);
    if (in_a != nullptr && in_b != nullptr) all.push_back({in_a, in_b, {}, {}});
  }
  std::vector<PairView> views;
  const size_t count = std::min(all.size(), kMaxPairViews);
  for (size_t i = 0; i < count; ++i) {
    PairView view = all[i * all.size() / count];
    view.a_from_target = EstimateViewPoses(ViewOf(problem, rays, *view.in_a));
    view.b_from_target = EstimateViewPoses(ViewOf(problem, rays, *view.in_b));
    if (!view.a_from_target.empty() && !view.b_from_target.empty()) views.push_back(view);
  }
  return views;
}

// The mean error of what b sees, from the target as a sees it, against the nearer of b's own poses.
double TransferErrorPx(const BundleProblem& problem, const PairView& view,
                       const RigidTransform& b_from_target) {
  const double focal_px = problem.CameraOf(*view.in_b).intrinsics[0];
  double best = kFarPx;
  for (const RigidTransform& seen : view.b_from_target) {
    double sum = 0;
    for (const BundleMarker& marker : problem.MarkersOf(*view.in_b)) {
      const Eigen::Vector3d& point =
          problem.rigid_target.points_m[static_cast<size_t>(marker.marker)];
      const Eigen::Vector3d x = b_from_target * point, y = seen * point;
      const double error_px = focal_px * (x.hnormalized() - y.hnormalized()).norm();
      sum += x.z() > 0 ? std::min(kFarPx, error_px) : kFarPx;
    }
    best = std::min(best, sum / std::max(1, view.in_b->marker_count));
  }
  return best;
}

double CostOf(const BundleProblem& problem, const std::vector<PairView>& views,
              const RigidTransform& b_from_a) {
  double cost = 0;
  for (const PairView& view : views) {
    double best = kFarPx;
    for (const RigidTransform& a_from_target : view.a_from_target) {
      best = std::min(best, TransferErrorPx(problem, view, b_from_a * a_from_target));
    }
    cost += best;
  }
  return cost;
}

// The two cameras alone with these views, in the frame of camera a. Residuals are pixels.
BundleProblem PairProblem(const BundleProblem& problem, const std::vector<PairView>& views, int a,
                          int b, const RigidTransform& b_from_a) {
  BundleProblem pair;
  pair.cameras = {problem.cameras[static_cast<size_t>(a)], problem.cameras[static_cast<size_t>(b)]};
  pair.cameras[0].cam_from_rig = RigidTransform();
  pair.cameras[1].cam_from_rig = b_from_a;
  for (BundleCamera& camera : pair.cameras) camera.pose_fixed = false;
  for (BundleCamera& camera : pair.cameras) camera.intrinsics_fixed = true;
  pair.cameras[0].pose_fixed = true;
  pair.clocks = problem.clocks;
  for (BundleClock& clock : pair.clocks) clock.offset_fixed = clock.rate_fixed = true;
  pair.rigid_target = problem.rigid_target;
  pair.rigid_target.fixed = true;
  for (const PairView& view : views) {
    BundleInstant instant;
    instant.is_rigid = true;
    instant.first_observation = static_cast<int>(pair.observations.size());
    instant.observation_count = 2;
    for (const BundleObservation* const from : {view.in_a, view.in_b}) {
      BundleObservation observation = *from;
      observation.camera = from == view.in_a ? 0 : 1;
      observation.first_marker = static_cast<int>(pair.markers.size());
      for (BundleMarker marker : problem.MarkersOf(*from)) {
        marker.sqrt_information.setIdentity();
        marker.used = true;
        pair.markers.push_back(marker);
      }
      pair.observations.push_back(observation);
    }
    pair.instants.push_back(instant);
  }
  return pair;
}

// Places the target in every instant and adjusts, twice, with a loss that gets narrower.
std::optional<RelativePose> Refine(const BundleProblem& problem, const std::vector<PairView>& views,
                                   int a, int b, const RigidTransform& b_from_a,
                                   const RigidPairOptions& options) {
  BundleProblem pair = PairProblem(problem, views, a, b, b_from_a);
  const std::vector<Eigen::Vector2d> rays = UndistortMarkers(pair);
  for (const double threshold_px : {0.5 * kFarPx, options.threshold_px}) {
    int placed = 0;
    for (BundleInstant& instant : pair.instants) {
      const auto fit = EstimateTargetPose(pair, {true, true}, rays, 2 * threshold_px, instant);
      if (fit) instant = fit->instant;
      instant.used = fit && 2 * fit->inliers > fit->markers;
      placed += instant.used ? 1 : 0;
    }
    if (placed < kMinAgreeing) return std::nullopt;
    BundleOptions bundle;
    bundle.loss_scale = threshold_px / 2;
    bundle.max_iterations = 30;
    bundle.function_tolerance = 1e-6;
    if (!AdjustBundle(bundle, &pair).ok()) return std::nullopt;
  }
  RelativePose pose{pair.cameras[1].cam_from_rig, static_cast<int>(pair.instants.size()), 0, 0};
  std::vector<double> errors;
  for (const BundleInstant& instant : pair.instants) {
    std::vector<double> own;
    for (const BundleObservation& observation : pair.ObservationsOf(instant)) {
      for (const BundleMarker& marker : pair.MarkersOf(observation)) {
        const auto residual = MarkerResidualPx(pair, instant, observation, marker);
        own.push_back(instant.used && residual ? residual->norm() : kInfinite);
      }
    }
    errors.insert(errors.end(), own.begin(), own.end());
    pose.inlier_count += UpperMedian(&own) < options.threshold_px ? 1 : 0;
  }
  if (pose.inlier_count < kMinAgreeing) return std::nullopt;
  pose.median_px = UpperMedian(&errors);
  return pose;
}

bool AreAlike(const RigidTransform& a, const RigidTransform& b) {
  const Eigen::Vector3d centre_a = a.SourceFromTargetTranslation(),
                        centre_b = b.SourceFromTargetTranslation();
  const double scale = std::max({centre_a.norm(), centre_b.norm(), 1e-9});
  return a.rotation.angularDistance(b.rotation) < kSameRad &&
         (centre_a - centre_b).norm() < kSameRad * scale;
}

}  // namespace

std::optional<RelativePose> EstimateRigidPairPose(const BundleProblem& problem,
                                                  const std::vector<Eigen::Vector2d>& rays, int a,
                                                  int b, const RigidPairOptions& options) {
  const std::vector<PairView> views = PairViews(problem, rays, a, b);
  if (static_cast<int>(views.size()) < kMinAgreeing) return std::nullopt;
  std::vector<Hypothesis> hypotheses;
  for (const PairView& view : views) {
    for (const RigidTransform& a_from_target : view.a_from_target) {
      for (const RigidTransform& b_from_target : view.b_from_target) {
        const RigidTransform b_from_a = b_from_target * a_from_target.Inverse();
        hypotheses.push_back({b_from_a, CostOf(problem, views, b_from_a)});
      }
    }
  }
  std::ranges::stable_sort(hypotheses, {}, &Hypothesis::cost);
  std::vector<RigidTransform> tried;
  std::vector<RelativePose> found;
  for (const Hypothesis& hypothesis : hypotheses) {
    if (tried.size() == kMaxRefined * static_cast<size_t>(options.rank + 1)) break;
    const auto alike = [](const RigidTransform& to) {
      return [&to](const RigidTransform& pose) { return AreAlike(pose, to); };
    };
    if (std::ranges::any_of(tried, alike(hypothesis.b_from_a))) continue;
    tried.push_back(hypothesis.b_from_a);
    const auto refined = Refine(problem, views, a, b, hypothesis.b_from_a, options);
    if (!refined || std::ranges::any_of(found, alike(refined->b_from_a), &RelativePose::b_from_a)) {
      continue;
    }
    found.push_back(*refined);
    // A wrong solution does not agree with so many.
    if (options.rank == 0 && 10 * refined->inlier_count > 9 * refined->instant_count) break;
  }
  if (found.empty()) return std::nullopt;
  std::ranges::stable_sort(found, [](const RelativePose& x, const RelativePose& y) {
    return x.inlier_count > y.inlier_count;
  });
  return found[std::min(static_cast<size_t>(options.rank), found.size() - 1)];
}

}  // namespace rigcal::server
