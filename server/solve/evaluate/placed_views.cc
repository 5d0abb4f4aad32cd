// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/placed_views.h"

#include <Eigen/Cholesky>
#include <optional>

#include "common/camera/camera_model.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/bundle/camera_order.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

constexpr int kPoseSize = 5;  // origin, and direction by two tangents
constexpr int kMinOthers = 2;
// Of a system with a unit diagonal: a smaller pivot is no information.
constexpr double kMinPivot = 1e-4;

using PoseMatrix = Eigen::Matrix<double, kPoseSize, kPoseSize>;
using PoseVector = Eigen::Matrix<double, kPoseSize, 1>;
using PointByPose = Eigen::Matrix<double, 3, kPoseSize>;

PointByPose DifferentiatePoint(const BundleProblem& problem, const BundleInstant& instant,
                               const BundleMarker& marker) {
  const double s = problem.target.marker_positions_m[static_cast<size_t>(marker.marker)];
  const Eigen::Vector3d tangent = instant.direction.unitOrthogonal();
  PointByPose by_pose;
  by_pose << Eigen::Matrix3d::Identity(), s * tangent, s * instant.direction.cross(tangent);
  return by_pose;
}

// What one camera's markers say of the pose of an instant.
struct PosePart {
  PoseMatrix information = PoseMatrix::Zero();
  PoseVector gradient = PoseVector::Zero();
  bool any = false;
};

PosePart PartOf(const BundleProblem& problem, const BundleInstant& instant,
                const BundleObservation& observation) {
  const double loss2 = BundleOptions().loss_scale * BundleOptions().loss_scale;
  const BundleCamera& camera = problem.CameraOf(observation);
  const Eigen::Matrix3d rotation = camera.cam_from_rig.rotation.toRotationMatrix();
  PosePart part;
  for (const BundleMarker& marker : problem.MarkersOf(observation)) {
    if (!marker.used) continue;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> by_point;
    if (!Project(camera.model, camera.intrinsics.data(),
                 camera.cam_from_rig * problem.PointOf(instant, marker), &pixel, &by_point,
                 nullptr)) {
      continue;
    }
    const Eigen::Matrix2d root = marker.sqrt_information;
    const Eigen::Vector2d residual =
        root * (pixel - CentreAtInstantPx(problem, observation, marker));
    const double weight = 1 / (1 + residual.squaredNorm() / loss2);
    const Eigen::Matrix<double, 2, kPoseSize> by_pose =
        root * by_point * rotation * DifferentiatePoint(problem, instant, marker);
    part.information += weight * by_pose.transpose() * by_pose;
    part.gradient += weight * by_pose.transpose() * residual;
    part.any = true;
  }
  return part;
}

// The pose of an instant without a camera, as a step from the present one.
struct PoseStep {
  PoseVector step = PoseVector::Zero();
  PoseMatrix root = PoseMatrix::Zero();  // root root^T is its covariance
};

// Of `size` of the numbers of a pose: a point has no direction.
std::optional<PoseStep> StepWithout(const PosePart& all, const PosePart& own, int size) {
  const Eigen::MatrixXd others = (all.information - own.information).topLeftCorner(size, size);
  if (!(others.diagonal().minCoeff() > 0)) return std::nullopt;
  const Eigen::VectorXd scale = others.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> factor(scale.asDiagonal() * others * scale.asDiagonal());
  if (factor.info() != Eigen::Success) return std::nullopt;
  const Eigen::MatrixXd lower = factor.matrixL();
  if (!(lower.diagonal().minCoeff() > kMinPivot)) return std::nullopt;
  PoseStep result;
  const Eigen::MatrixXd root =
      lower.transpose().triangularView<Eigen::Upper>().solve(Eigen::MatrixXd::Identity(size, size));
  result.root.topLeftCorner(size, size) = scale.asDiagonal() * root;
  const auto corner = result.root.topLeftCorner(size, size);
  result.step.head(size) =
      -corner * (corner.transpose() * (all.gradient - own.gradient).head(size));
  return result;
}

PlacedView ViewOf(const BundleProblem& problem, size_t index, const BundleObservation& observation,
                  const PoseStep& pose, double far_px) {
  const BundleInstant& instant = problem.instants[index];
  const BundleCamera& camera = problem.CameraOf(observation);
  PlacedView view;
  view.instant = index;
  std::vector<Eigen::Matrix<double, 2, kPoseSize>> by_pose;
  std::vector<Eigen::Matrix2d> centre_covariance;
  for (const BundleMarker& marker : problem.MarkersOf(observation)) {
    if (!marker.used) {
      const auto residual = MarkerResidualPx(problem, instant, observation, marker);
      if (!residual || residual->norm() > far_px) continue;
    }
    const PointByPose by = DifferentiatePoint(problem, instant, marker);
    const Eigen::Vector3d x_in_rig = problem.PointOf(instant, marker) + by * pose.step;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> by_point;
    if (!Project(camera.model, camera.intrinsics.data(), camera.cam_from_rig * x_in_rig, &pixel,
                 &by_point, nullptr)) {
      continue;
    }
    by_pose.emplace_back(by_point * camera.cam_from_rig.rotation.toRotationMatrix() * by *
                         pose.root);
    const Eigen::Matrix2d root = marker.sqrt_information;
    centre_covariance.emplace_back((root.transpose() * root).inverse());
    view.x_in_rig.push_back(x_in_rig);
    view.centre_px.push_back(CentreAtInstantPx(problem, observation, marker));
  }
  const auto size = static_cast<Eigen::Index>(2 * by_pose.size());
  Eigen::MatrixXd in_common(size, kPoseSize);
  for (size_t m = 0; m < by_pose.size(); ++m) {
    in_common.middleRows<2>(static_cast<Eigen::Index>(2 * m)) = by_pose[m];
  }
  Eigen::MatrixXd covariance = in_common * in_common.transpose();
  for (size_t m = 0; m < by_pose.size(); ++m) {
    const auto at = static_cast<Eigen::Index>(2 * m);
    covariance.block<2, 2>(at, at) += centre_covariance[m];
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  view.whitening = factor.matrixL().solve(Eigen::MatrixXd::Identity(size, size));
  return view;
}

}  // namespace

bool LooksAtLensesAlone(const BundleProblem& problem) {
  return !NeedsGeneralPath(problem) && OrderCameras(problem).is_sparse;
}

std::vector<std::vector<PlacedView>> PlaceByOthers(const BundleProblem& problem,
                                                   const std::vector<bool>& cameras,
                                                   size_t max_views, double far_px) {
  std::vector<size_t> counts(problem.cameras.size(), 0), met = counts;
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used || instant.is_rigid) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      ++counts[static_cast<size_t>(observation.camera)];
    }
  }
  const int size = problem.target.marker_positions_m.size() == 1 ? 3 : kPoseSize;
  std::vector<std::vector<PlacedView>> views(problem.cameras.size());
  std::vector<PosePart> parts;
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    const BundleInstant& instant = problem.instants[i];
    if (!instant.used || instant.is_rigid) continue;
    const auto observations = problem.ObservationsOf(instant);
    parts.clear();
    PosePart all;
    int seeing = 0;
    for (const BundleObservation& observation : observations) {
      const PosePart& part = parts.emplace_back(PartOf(problem, instant, observation));
      all.information += part.information;
      all.gradient += part.gradient;
      seeing += part.any ? 1 : 0;
    }
    for (size_t o = 0; o < observations.size(); ++o) {
      const auto camera = static_cast<size_t>(observations[o].camera);
      const size_t stride = 1 + counts[camera] / max_views;
      if (!cameras[camera] || met[camera]++ % stride != 0) continue;
      if (seeing - (parts[o].any ? 1 : 0) < kMinOthers) continue;
      const auto pose = StepWithout(all, parts[o], size);
      if (!pose) continue;
      PlacedView view = ViewOf(problem, i, observations[o], *pose, far_px);
      if (!view.x_in_rig.empty() && view.whitening.allFinite()) {
        views[camera].push_back(std::move(view));
      }
    }
  }
  return views;
}

}  // namespace rigcal::server
