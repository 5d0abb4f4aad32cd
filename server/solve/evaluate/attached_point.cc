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

std::vector<Eigen::Index> PoseRows(const RigUncertainty& rig, int camera) {
  std::vector<Eigen::Index> rows;
  if (rig.Row({ReducedParameterKind::kRotation, camera, 0}) < 0) return rows;
  for (const auto kind : {ReducedParameterKind::kRotation, ReducedParameterKind::kTranslation}) {
    for (int i = 0; i < 3; ++i) rows.push_back(rig.Row({kind, camera, i}));
  }
  return rows;
}

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
  const RigidMotion rigid = FindRigidMotion(points_m, gain);
  // A centre moves by its own camera's parameters alone, but for the motion that is taken out.
  const auto motions = rigid.motions.topRows(3 * count);
  std::vector<std::vector<Eigen::Index>> rows;
  std::vector<Eigen::MatrixXd> own;
  Eigen::MatrixXd by_motion(3 * count, 6);  // covariance of the centres with the motion
  const Eigen::MatrixXd of_motion = rig.shape_covariance * rigid.taken.transpose();
  for (Eigen::Index c = 0; c < count; ++c) {
    rows.push_back(PoseRows(rig, static_cast<int>(c)));
    own.push_back(gain.middleRows<3>(3 * c)(Eigen::all, rows.back()));
    by_motion.middleRows<3>(3 * c) = own.back() * of_motion(rows.back(), Eigen::all);
  }
  Eigen::MatrixXd covariance(3 * count, 3 * count);
  for (size_t a = 0; a < own.size(); ++a) {
    for (size_t b = 0; b < own.size(); ++b) {
      covariance.block<3, 3>(static_cast<Eigen::Index>(3 * a), static_cast<Eigen::Index>(3 * b)) =
          own[a] * (rig.shape_covariance(rows[a], rows[b]) * own[b].transpose()).eval();
    }
  }
  const Eigen::MatrixXd shared = by_motion - 0.5 * motions * (rigid.taken * of_motion).eval();
  covariance.noalias() -= shared * motions.transpose();
  covariance.noalias() -= motions * shared.transpose();
  return covariance;
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
