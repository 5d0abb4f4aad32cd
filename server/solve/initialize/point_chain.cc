// SPDX-License-Identifier: Apache-2.0
#include "server/solve/initialize/point_chain.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/geometry/triangulation.h"
#include "server/solve/initialize/initialization.h"
#include "server/solve/initialize/point_joins.h"

namespace rigcal::server {
namespace {

constexpr double kMinSine = 0.005;  // of the angle between two rays, for a depth to say something
constexpr double kMaxLogScale = 0.35;
constexpr double kMaxErrorPx = 4 * kAgreePx;

class PointChain {
 public:
  PointChain(const OverlapGraph& graph, const std::vector<Eigen::Vector2d>& rays,
             const PairEstimate& estimate, const BundleProblem& problem)
      : graph_(graph),
        problem_(problem),
        count_(static_cast<int>(problem.cameras.size())),
        estimate_(estimate),
        instants_(SharedRays(problem, rays)),
        joins_(graph, instants_) {}

  // cam_from_rig by camera, in the frame and the unit of the pair it began with.
  absl::StatusOr<std::vector<RigidTransform>> Run() {
    // First the connectivity that every target needs, with the same error messages.
    RIGCAL_RETURN_IF_ERROR(
        FindSpanningTree(graph_, [this](int a, int b) { return Pair(a, b); }).status());
    std::vector<bool> best;
    for (const auto& [a, b] : joins_.Seeds()) {
      RIGCAL_ASSIGN_OR_RETURN(const std::vector<bool> reached, GrowFrom(a, b));
      const auto size = [](const std::vector<bool>& set) {
        return std::count(set.begin(), set.end(), true);
      };
      if (size(reached) == count_) return poses_;
      if (size(reached) > size(best)) best = reached;
    }
    return joins_.NotJoined(best);
  }

 private:
  using CameraPair = PointJoins::CameraPair;

  // The pose of a pair, estimated once.
  absl::StatusOr<std::optional<RelativePose>> Pair(int a, int b) {
    const auto known = pairs_.find({a, b});
    if (known != pairs_.end()) return known->second;
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<RelativePose> pose, estimate_(a, b));
    return pairs_[{a, b}] = pose;
  }

  // b_from_a in whatever order, none where the pair has no pose.
  absl::StatusOr<std::optional<RigidTransform>> FromTo(int from, int to) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<RelativePose> pose,
                            Pair(std::min(from, to), std::max(from, to)));
    if (!pose) return std::optional<RigidTransform>();
    return std::optional<RigidTransform>(from < to ? pose->b_from_a : pose->b_from_a.Inverse());
  }

  // Joins cameras to a pair while there are any that can be. Which ones are.
  absl::StatusOr<std::vector<bool>> GrowFrom(int a, int b) {
    std::vector<bool> joined(static_cast<size_t>(count_), false);
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<RigidTransform> seed, FromTo(a, b));
    if (!seed) return joined;
    poses_.assign(static_cast<size_t>(count_), RigidTransform::Identity());
    poses_[static_cast<size_t>(b)] = *seed;
    joined[static_cast<size_t>(a)] = joined[static_cast<size_t>(b)] = true;
    std::set<CameraPair> failed;
    for (;;) {
      const PointJoins::Join join = joins_.Best(joined, failed);
      if (join.next < 0) return joined;
      RIGCAL_ASSIGN_OR_RETURN(std::optional<RigidTransform> next_from_via,
                              FromTo(join.via, join.next));
      const std::optional<double> baseline =
          next_from_via ? Baseline(joined, join, *next_from_via) : std::nullopt;
      if (!baseline) {
        failed.insert({join.via, join.next});
        continue;
      }
      next_from_via->translation_m *= *baseline;
      poses_[static_cast<size_t>(join.next)] =
          *next_from_via * poses_[static_cast<size_t>(join.via)];
      joined[static_cast<size_t>(join.next)] = true;
    }
  }

  // The length of the baseline, from depths in camera `via`.
  std::optional<double> Baseline(const std::vector<bool>& joined, const PointJoins::Join& join,
                                 const RigidTransform& next_from_via) const {
    std::vector<double> log_scales;
    for (const RaysOfInstant& views : instants_) {
      const RayOfCamera *via = nullptr, *next = nullptr;
      std::vector<RayOfCamera> known;
      for (const RayOfCamera& view : views) {
        if (view.camera == join.via) via = &view;
        if (view.camera == join.next) next = &view;
        if (joined[static_cast<size_t>(view.camera)]) known.push_back(view);
      }
      if (via == nullptr || next == nullptr || known.size() < 2) continue;
      const std::optional<double> depth = KnownDepth(known, *via);
      const std::optional<double> unit_depth = UnitDepth(*via, *next, next_from_via);
      if (depth && unit_depth) log_scales.push_back(std::log(*depth / *unit_depth));
    }
    if (static_cast<int>(log_scales.size()) < graph_.min_shared) return std::nullopt;
    const double median = UpperMedian(&log_scales);
    const auto agree = std::ranges::count_if(
        log_scales, [median](double value) { return std::abs(value - median) < kMaxLogScale; });
    return agree < graph_.min_shared ? std::nullopt : std::optional(std::exp(median));
  }

  // Depth in the camera of `via` of what the joined cameras see, where they agree about it.
  std::optional<double> KnownDepth(const std::vector<RayOfCamera>& known,
                                   const RayOfCamera& via) const {
    std::vector<CameraRay> views;
    double sine = 0;
    const RigidTransform& via_pose = poses_[static_cast<size_t>(via.camera)];
    for (const RayOfCamera& view : known) {
      const RigidTransform& pose = poses_[static_cast<size_t>(view.camera)];
      views.push_back({pose, view.ray});
      sine = std::max(sine, Sine(view.ray, via.ray, pose * via_pose.Inverse()));
    }
    const auto point = Triangulate(views);
    if (sine < kMinSine || !point) return std::nullopt;
    for (size_t i = 0; i < views.size(); ++i) {
      const IntrinsicsVector& intrinsics =
          problem_.cameras[static_cast<size_t>(known[i].camera)].intrinsics;
      const double error_px = 0.5 * (intrinsics[0] + intrinsics[1]) * RayError(views[i], *point);
      if (!(error_px < kMaxErrorPx)) return std::nullopt;
    }
    return (via_pose * *point).z();
  }

  static std::optional<double> UnitDepth(const RayOfCamera& via, const RayOfCamera& next,
                                         const RigidTransform& next_from_via) {
    if (Sine(next.ray, via.ray, next_from_via) < kMinSine) return std::nullopt;
    const auto point =
        TriangulatePair({RigidTransform::Identity(), via.ray}, {next_from_via, next.ray});
    return point ? std::optional(point->z()) : std::nullopt;
  }

  // Of the angle between two cameras' rays.
  static double Sine(const Eigen::Vector2d& ray_a, const Eigen::Vector2d& ray_b,
                     const RigidTransform& a_from_b) {
    const Eigen::Vector3d a = ray_a.homogeneous(), b = a_from_b.rotation * ray_b.homogeneous();
    return a.cross(b).norm() / (a.norm() * b.norm());
  }

  const OverlapGraph& graph_;
  const BundleProblem& problem_;
  const int count_;
  const PairEstimate& estimate_;
  const std::vector<RaysOfInstant> instants_;
  const PointJoins joins_;
  std::map<CameraPair, std::optional<RelativePose>> pairs_;
  std::vector<RigidTransform> poses_;
};

Eigen::Vector3d Centre(const RigidTransform& cam_from_rig) {
  return cam_from_rig.SourceFromTargetTranslation();
}

// Puts the poses into the fixed camera's frame and gives them their unit.
absl::Status Adopt(const std::vector<RigidTransform>& poses, BundleProblem* problem) {
  size_t fixed = 0;
  while (!problem->cameras[fixed].pose_fixed) ++fixed;
  const RigidTransform kept = problem->cameras[fixed].cam_from_rig;
  double farthest = -1;
  int unit_camera = -1;
  for (size_t c = 0; c < poses.size(); ++c) {
    const double away = (Centre(poses[c]) - Centre(poses[fixed])).norm();
    if (c == fixed || away <= farthest) continue;
    farthest = away;
    unit_camera = static_cast<int>(c);
  }
  if (!problem->distance) {
    problem->distance = BundleDistance{static_cast<int>(fixed), unit_camera, 1};
  }
  const BundleDistance& distance = *problem->distance;
  const double length = (Centre(poses[static_cast<size_t>(distance.camera_b)]) -
                         Centre(poses[static_cast<size_t>(distance.camera_a)]))
                            .norm();
  if (!(length > 1e-6 * farthest)) {
    return absl::FailedPreconditionError(absl::StrCat(
        "cameras ", problem->cameras[static_cast<size_t>(distance.camera_a)].name, " and ",
        problem->cameras[static_cast<size_t>(distance.camera_b)].name,
        " are in one place as far as the images tell: their distance cannot give the scale"));
  }
  const double unit = distance.distance_m / length;
  const RigidTransform fixed_from_start = poses[fixed].Inverse();
  for (size_t c = 0; c < poses.size(); ++c) {
    if (c == fixed) continue;
    RigidTransform from_fixed = poses[c] * fixed_from_start;
    from_fixed.translation_m *= unit;
    problem->cameras[c].cam_from_rig = from_fixed * kept;
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ChainPointPoses(const OverlapGraph& graph, const std::vector<Eigen::Vector2d>& rays,
                             const PairEstimate& estimate, BundleProblem* problem) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<RigidTransform> poses,
                          PointChain(graph, rays, estimate, *problem).Run());
  return Adopt(poses, problem);
}

}  // namespace rigcal::server
