// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/target_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <utility>

#include "common/camera/camera_model.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/geometry/rigid_pose.h"
#include "server/solve/geometry/triangulation.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxPairs = 12;
constexpr int kRefineSteps = 6;
constexpr double kRefined = 1e-5;  // a step this small, of metres and radians, is the last
constexpr int kMinRigidInliers = 4;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// A span triangulated from two cameras may be off by this share and still be a hypothesis.
constexpr double kSpanShare = 0.35;

struct ScoredFit {
  TargetFit fit;
  double cost = kInfinity;
};

// Stops as soon as the cost is beyond `most`: the score is then of no use.
ScoredFit Evaluate(const BundleProblem& problem, const std::vector<bool>& has_pose,
                   double truncation_px, const BundleInstant& instant, double most) {
  ScoredFit score = {{instant}, 0};
  const double limit = truncation_px * truncation_px;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    if (!has_pose[static_cast<size_t>(observation.camera)]) continue;
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      if (!marker.used) continue;
      ++score.fit.markers;
      const auto residual = MarkerResidualPx(problem, instant, observation, marker);
      const bool is_inlier = residual && residual->squaredNorm() < limit;
      score.fit.inliers += is_inlier ? 1 : 0;
      score.cost += is_inlier ? residual->squaredNorm() : limit;
      if (score.cost > most) return score;
    }
  }
  return score;
}

struct MarkerPoint {
  int marker;
  double position_m;  // along a line target
  Eigen::Vector3d x_in_rig;
};

// The markers both observations show, triangulated.
std::vector<MarkerPoint> CommonMarkers(const BundleProblem& problem,
                                       const std::vector<Eigen::Vector2d>& rays,
                                       const BundleObservation& a, const BundleObservation& b) {
  std::vector<MarkerPoint> points;
  const RigidTransform &pose_a = problem.CameraOf(a).cam_from_rig,
                       &pose_b = problem.CameraOf(b).cam_from_rig;
  for (const BundleMarker& marker_a : problem.MarkersOf(a)) {
    const Eigen::Vector2d& ray_a = rays[problem.IndexOf(marker_a)];
    for (const BundleMarker& marker_b : problem.MarkersOf(b)) {
      const Eigen::Vector2d& ray_b = rays[problem.IndexOf(marker_b)];
      if (marker_a.marker != marker_b.marker || !marker_a.used || !marker_b.used) continue;
      if (!ray_a.allFinite() || !ray_b.allFinite()) continue;
      if (const auto point = TriangulatePair({pose_a, ray_a}, {pose_b, ray_b})) {
        const auto m = static_cast<size_t>(marker_a.marker);
        const bool is_line = m < problem.target.marker_positions_m.size();
        points.push_back(
            {marker_a.marker, is_line ? problem.target.marker_positions_m[m] : 0, *point});
      }
    }
  }
  return points;
}

std::optional<BundleInstant> Hypothesis(const BundleInstant& instant, const MarkerPoint& a,
                                        const MarkerPoint& b) {
  const Eigen::Vector3d difference = b.x_in_rig - a.x_in_rig;
  const double span_m = b.position_m - a.position_m;
  const double length_m = difference.norm();
  if (span_m == 0 || std::abs(length_m - std::abs(span_m)) > kSpanShare * std::abs(span_m)) {
    return std::nullopt;
  }
  BundleInstant result = instant;
  result.direction = difference / (span_m > 0 ? length_m : -length_m);
  result.origin_m =
      0.5 * (a.x_in_rig + b.x_in_rig) - 0.5 * (a.position_m + b.position_m) * result.direction;
  return result;
}

using ObservationPair = std::pair<const BundleObservation*, const BundleObservation*>;

std::vector<ObservationPair> ObservationPairs(const BundleProblem& problem,
                                              const std::vector<bool>& has_pose,
                                              const BundleInstant& instant) {
  std::vector<const BundleObservation*> posed;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    if (has_pose[static_cast<size_t>(observation.camera)]) posed.push_back(&observation);
  }
  std::vector<ObservationPair> pairs;
  // By distance in the list, so that a cut at kMaxPairs still touches every camera.
  for (size_t step = 1; step < posed.size() && pairs.size() < kMaxPairs; ++step) {
    for (size_t i = 0; i + step < posed.size() && pairs.size() < kMaxPairs; ++i) {
      pairs.emplace_back(posed[i], posed[i + step]);
    }
  }
  return pairs;
}

// Gauss-Newton on the 5 degrees of freedom with Cauchy weights.
void Refine(const BundleProblem& problem, const std::vector<bool>& has_pose, double scale_px,
            BundleInstant* instant) {
  for (int step = 0; step < kRefineSteps; ++step) {
    Eigen::Matrix<double, 3, 2> tangent;
    const Eigen::Vector3d& direction = instant->direction;
    tangent.col(0) = direction.unitOrthogonal();
    tangent.col(1) = direction.cross(tangent.col(0));
    Eigen::Matrix<double, 5, 5> hessian = Eigen::Matrix<double, 5, 5>::Identity() * 1e-9;
    Eigen::Matrix<double, 5, 1> gradient = Eigen::Matrix<double, 5, 1>::Zero();
    for (const BundleObservation& observation : problem.ObservationsOf(*instant)) {
      if (!has_pose[static_cast<size_t>(observation.camera)]) continue;
      const BundleCamera& camera = problem.CameraOf(observation);
      const Eigen::Matrix3d rotation = camera.cam_from_rig.rotation.toRotationMatrix();
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        if (!marker.used) continue;
        const double s = problem.target.marker_positions_m[static_cast<size_t>(marker.marker)];
        Eigen::Vector2d pixel;
        Eigen::Matrix<double, 2, 3> d_point;
        if (!Project(camera.model, camera.intrinsics.data(),
                     camera.cam_from_rig * (instant->origin_m + s * direction), &pixel, &d_point,
                     nullptr)) {
          continue;
        }
        const Eigen::Vector2d residual = pixel - CentreAtInstantPx(problem, observation, marker);
        const double weight = 1 / (1 + residual.squaredNorm() / (scale_px * scale_px));
        Eigen::Matrix<double, 2, 5> jacobian;
        jacobian.leftCols<3>() = d_point * rotation;
        jacobian.rightCols<2>() = s * jacobian.leftCols<3>() * tangent;
        hessian += weight * jacobian.transpose() * jacobian;
        gradient += weight * jacobian.transpose() * residual;
      }
    }
    const Eigen::Matrix<double, 5, 1> delta = hessian.ldlt().solve(gradient);
    if (!delta.allFinite()) return;
    instant->origin_m -= delta.head<3>();
    instant->direction = (direction - tangent * delta.tail<2>()).normalized();
    if (delta.norm() < kRefined) return;
  }
}

// Gauss-Newton on the 6 degrees of freedom of a rigid target with Cauchy weights.
void RefineRigid(const BundleProblem& problem, const std::vector<bool>& has_pose, double scale_px,
                 BundleInstant* instant) {
  for (int step = 0; step < kRefineSteps; ++step) {
    Eigen::Matrix<double, 6, 6> hessian = Eigen::Matrix<double, 6, 6>::Identity() * 1e-9;
    Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
    for (const BundleObservation& observation : problem.ObservationsOf(*instant)) {
      if (!has_pose[static_cast<size_t>(observation.camera)]) continue;
      const BundleCamera& camera = problem.CameraOf(observation);
      const Eigen::Matrix3d rotation = camera.cam_from_rig.rotation.toRotationMatrix();
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        if (!marker.used) continue;
        const Eigen::Vector3d x_in_rig = problem.PointOf(*instant, marker);
        const Eigen::Vector3d arm = x_in_rig - instant->origin_m;
        Eigen::Vector2d pixel;
        Eigen::Matrix<double, 2, 3> d_point;
        if (!Project(camera.model, camera.intrinsics.data(), camera.cam_from_rig * x_in_rig, &pixel,
                     &d_point, nullptr)) {
          continue;
        }
        const Eigen::Vector2d residual = pixel - CentreAtInstantPx(problem, observation, marker);
        const double weight = 1 / (1 + residual.squaredNorm() / (scale_px * scale_px));
        Eigen::Matrix<double, 2, 6> jacobian;
        jacobian.leftCols<3>() = d_point * rotation;
        for (int i = 0; i < 3; ++i) {
          jacobian.col(3 + i) = jacobian.leftCols<3>() * Eigen::Vector3d::Unit(i).cross(arm);
        }
        hessian += weight * jacobian.transpose() * jacobian;
        gradient += weight * jacobian.transpose() * residual;
      }
    }
    const Eigen::Matrix<double, 6, 1> delta = hessian.ldlt().solve(gradient);
    if (!delta.allFinite()) return;
    instant->origin_m -= delta.head<3>();
    const Eigen::Vector3d turn = -delta.tail<3>();
    const double angle = turn.norm();
    const Eigen::Vector3d axis = angle > 0 ? Eigen::Vector3d(turn / angle) : turn;
    instant->rotation =
        (Eigen::AngleAxisd(angle, axis) * Eigen::Quaterniond(instant->rotation)).normalized();
    if (delta.norm() < kRefined) return;
  }
}

// Hypotheses from each view alone, then from what pairs of cameras triangulate.
std::optional<TargetFit> EstimateRigidPose(const BundleProblem& problem,
                                           const std::vector<bool>& has_pose,
                                           const std::vector<Eigen::Vector2d>& rays,
                                           double truncation_px, const BundleInstant& instant) {
  ScoredFit best;
  const auto consider = [&](const RigidTransform& rig_from_target) {
    BundleInstant candidate = instant;
    candidate.origin_m = rig_from_target.translation_m;
    candidate.rotation = rig_from_target.rotation;
    ScoredFit score =
        Evaluate(problem, has_pose, truncation_px, candidate, std::numeric_limits<double>::max());
    // One view says little about the depth: it needs the others.
    RefineRigid(problem, has_pose, 2 * truncation_px, &candidate);
    const ScoredFit refined =
        Evaluate(problem, has_pose, truncation_px, candidate, std::numeric_limits<double>::max());
    if (refined.cost < score.cost && candidate.origin_m.allFinite()) score = refined;
    if (score.cost < best.cost) best = score;
  };
  const auto all_agree = [&best] {
    return best.fit.markers > 0 && best.fit.inliers == best.fit.markers;
  };
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    if (!has_pose[static_cast<size_t>(observation.camera)] || all_agree()) continue;
    const RigidTransform rig_from_cam = problem.CameraOf(observation).cam_from_rig.Inverse();
    for (const RigidTransform& pose : EstimateViewPoses(ViewOf(problem, rays, observation))) {
      consider(rig_from_cam * pose);
    }
  }
  std::vector<Eigen::Vector3d> points_m, points_in_rig;
  for (const auto& [a, b] : ObservationPairs(problem, has_pose, instant)) {
    if (all_agree()) break;
    for (const MarkerPoint& point : CommonMarkers(problem, rays, *a, *b)) {
      points_m.push_back(problem.rigid_target.points_m[static_cast<size_t>(point.marker)]);
      points_in_rig.push_back(point.x_in_rig);
    }
  }
  if (!all_agree()) {
    if (const auto aligned = AlignRigidTarget(points_m, points_in_rig)) consider(*aligned);
  }
  if (!std::isfinite(best.cost) || best.fit.inliers < kMinRigidInliers) return std::nullopt;
  RefineRigid(problem, has_pose, truncation_px / 3, &best.fit.instant);
  return Evaluate(problem, has_pose, truncation_px, best.fit.instant,
                  std::numeric_limits<double>::max())
      .fit;
}

}  // namespace

std::optional<TargetFit> EstimateTargetPose(const BundleProblem& problem,
                                            const std::vector<bool>& has_pose,
                                            const std::vector<Eigen::Vector2d>& rays,
                                            double truncation_px, const BundleInstant& instant) {
  if (instant.is_rigid && !instant.is_point) {
    return EstimateRigidPose(problem, has_pose, rays, truncation_px, instant);
  }
  ScoredFit best;
  std::vector<MarkerPoint> points;
  const auto try_pose = [&](const BundleInstant& candidate) {
    const ScoredFit score = Evaluate(problem, has_pose, truncation_px, candidate, best.cost);
    if (score.cost < best.cost) best = score;
  };
  const auto consider = [&](const MarkerPoint& a, const MarkerPoint& b) {
    if (const auto candidate = Hypothesis(instant, a, b)) try_pose(*candidate);
  };
  const bool is_point = instant.is_point || problem.target.marker_positions_m.size() == 1;
  for (const auto& [a, b] : ObservationPairs(problem, has_pose, instant)) {
    // With a pose that no marker contradicts, only the last pixels are left to be refined.
    if (best.fit.markers > 0 && best.fit.inliers == best.fit.markers) break;
    const std::vector<MarkerPoint> common = CommonMarkers(problem, rays, *a, *b);
    for (size_t i = 0; i < common.size(); ++i) {
      if (is_point) {
        BundleInstant candidate = instant;
        const double position_m = instant.is_point ? 0 : common[i].position_m;
        candidate.origin_m = common[i].x_in_rig - position_m * instant.direction;
        try_pose(candidate);
      }
      for (size_t j = i + 1; j < common.size(); ++j) consider(common[i], common[j]);
    }
    points.insert(points.end(), common.begin(), common.end());
  }
  if (!std::isfinite(best.cost)) {
    // No one pair shows two markers; markers from different pairs may.
    for (size_t i = 0; i < points.size(); ++i) {
      for (size_t j = i + 1; j < points.size(); ++j) consider(points[i], points[j]);
    }
  }
  if (!std::isfinite(best.cost)) return std::nullopt;
  BundleInstant refined = best.fit.instant;
  if (instant.is_point) {
    RefineRigid(problem, has_pose, truncation_px / 3, &refined);
  } else {
    Refine(problem, has_pose, truncation_px / 3, &refined);
  }
  const ScoredFit score = Evaluate(problem, has_pose, truncation_px, refined, best.cost);
  if (refined.origin_m.allFinite() && refined.direction.allFinite() && score.cost <= best.cost) {
    best = score;
  }
  return best.fit;
}

}  // namespace rigcal::server
