// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/attached_point.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace rigcal::server {
namespace {

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

}  // namespace

// Of X = R^T (p - t) with p fixed, under t + dt and exp([w]x) R:
// dX = -R^T dt + R^T [p - t]x w = -R^T dt + R^T [R X]x w.
PointGainMatrix AttachedPointGain(const BundleProblem& problem, const RigUncertainty& rig,
                                  int camera, const Eigen::Vector3d& point_m) {
  PointGainMatrix gain = PointGainMatrix::Zero(3, rig.covariance.cols());
  if (rig.Row({ReducedParameterKind::kRotation, camera, 0}) < 0) return gain;
  const RigidTransform& pose = problem.cameras[static_cast<size_t>(camera)].cam_from_rig;
  const Eigen::Matrix3d rig_from_cam = pose.rotation.toRotationMatrix().transpose();
  const Eigen::Matrix3d turn = rig_from_cam * CrossMatrix(pose.rotation * point_m);
  for (int i = 0; i < 3; ++i) {
    gain.col(rig.Row({ReducedParameterKind::kRotation, camera, i})) = turn.col(i);
    gain.col(rig.Row({ReducedParameterKind::kTranslation, camera, i})) = -rig_from_cam.col(i);
  }
  return gain;
}

Eigen::MatrixXd FrameFreeCentreCovariance(const BundleProblem& problem, const RigUncertainty& rig,
                                          const Eigen::Vector3d& middle_m) {
  const auto count = static_cast<Eigen::Index>(problem.cameras.size());
  if (count == 0) return {};
  // The centres first, then the places.
  std::vector<Eigen::Vector3d> points_m;
  for (const BundleCamera& camera : problem.cameras) {
    points_m.push_back(camera.cam_from_rig.SourceFromTargetTranslation());
  }
  points_m.resize(2 * points_m.size(), middle_m);
  PointGainMatrix gain(6 * count, rig.covariance.cols());
  for (Eigen::Index i = 0; i < 2 * count; ++i) {
    gain.middleRows<3>(3 * i) = AttachedPointGain(problem, rig, static_cast<int>(i % count),
                                                  points_m[static_cast<size_t>(i)]);
  }
  RemoveRigidMotion(points_m, &gain);
  const auto centres = gain.topRows(3 * count);
  return centres * rig.shape_covariance * centres.transpose();
}

std::vector<double> CentreSigmas(const Eigen::MatrixXd& centre_covariance) {
  std::vector<double> sigmas_m;
  for (Eigen::Index i = 0; i < centre_covariance.rows(); i += 3) {
    sigmas_m.push_back(std::sqrt(std::max(0.0, centre_covariance.diagonal().segment<3>(i).sum())));
  }
  return sigmas_m;
}

std::vector<double> FrameFreeCentreSigmas(const BundleProblem& problem, const RigUncertainty& rig,
                                          const Eigen::Vector3d& middle_m) {
  return CentreSigmas(FrameFreeCentreCovariance(problem, rig, middle_m));
}

std::vector<double> FrameFreeCentreDistances(const std::vector<RigidTransform>& cam_from_rig,
                                             const std::vector<RigidTransform>& other_cam_from_rig,
                                             const Eigen::Vector3d& middle_m) {
  const auto count = static_cast<Eigen::Index>(cam_from_rig.size());
  if (count == 0) return {};
  Eigen::Matrix3Xd points_m(3, 2 * count), others_m(3, 2 * count);
  for (Eigen::Index i = 0; i < 2 * count; ++i) {
    const auto camera = static_cast<size_t>(i % count);
    const RigidTransform& pose = cam_from_rig[camera];
    points_m.col(i) = i < count ? pose.SourceFromTargetTranslation() : middle_m;
    others_m.col(i) = other_cam_from_rig[camera].Inverse() * (pose * points_m.col(i).eval());
  }
  const Eigen::Matrix4d aligned_from_other = Eigen::umeyama(others_m, points_m, false);
  const Eigen::Matrix3Xd difference_m =
      ((aligned_from_other.topLeftCorner<3, 3>() * others_m).colwise() +
       aligned_from_other.topRightCorner<3, 1>()) -
      points_m;
  std::vector<double> distances_m;
  for (Eigen::Index c = 0; c < count; ++c) distances_m.push_back(difference_m.col(c).norm());
  return distances_m;
}

}  // namespace rigcal::server
