// SPDX-License-Identifier: Apache-2.0
#include "common/origin/frame_change.h"

#include <utility>

#include "common/camera/intrinsics_vector.h"

namespace rigcal {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

// How cam_from_new moves with cam_from_rig and with new_from_rig.
struct PoseDerivatives {
  Matrix6 by_pose = Matrix6::Identity(), by_change = Matrix6::Zero();

  PoseDerivatives(const RigidTransform& cam_from_new, const RigidTransform& new_from_rig) {
    const Eigen::Matrix3d rotation = cam_from_new.rotation.toRotationMatrix();
    const Eigen::Matrix3d lever = Cross(rotation * new_from_rig.translation_m);
    by_pose.bottomLeftCorner<3, 3>() = lever;
    by_change.topLeftCorner<3, 3>() = -rotation;
    by_change.bottomLeftCorner<3, 3>() = -lever * rotation;
    by_change.bottomRightCorner<3, 3>() = -rotation;
  }
};

// One sigma of a pose from its covariance (rotation vector, translation of cam_from_rig).
void SetPoseSigmas(const Matrix6& covariance, const RigidTransform& cam_from_rig,
                   CameraUncertainty* uncertainty) {
  Eigen::Matrix<double, 3, 6> centre;
  const Eigen::Matrix3d back = cam_from_rig.rotation.conjugate().toRotationMatrix();
  centre.leftCols<3>() = -back * Cross(cam_from_rig.translation_m);
  centre.rightCols<3>() = -back;
  uncertainty->rotation_sigma_rad = covariance.diagonal().head<3>().cwiseMax(0).cwiseSqrt();
  uncertainty->position_sigma_m =
      (centre * covariance * centre.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
}

WandVolume MovedVolume(const WandVolume& volume, const RigidTransform& new_from_rig) {
  WandVolume moved;
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d x;
    for (int axis = 0; axis < 3; ++axis) {
      x[axis] = (corner >> axis & 1) != 0 ? volume.max_m[axis] : volume.min_m[axis];
    }
    x = new_from_rig * x;
    moved.min_m = corner == 0 ? x : moved.min_m.cwiseMin(x).eval();
    moved.max_m = corner == 0 ? x : moved.max_m.cwiseMax(x).eval();
  }
  return moved;
}

}  // namespace

Eigen::Matrix<double, 6, 6> FrameChange::Covariance(const CameraCovariance& calibration) const {
  if (by_parameters.cols() == 0 || by_parameters.cols() != calibration.matrix.rows()) {
    return own_covariance;
  }
  return own_covariance + by_parameters * calibration.matrix * by_parameters.transpose();
}

CalibrationResult ChangeFrame(const CalibrationResult& calibration, const FrameChange& change) {
  const CameraCovariance old = UnpackCameraCovariance(calibration);
  CalibrationResult moved = calibration;
  moved.reference_camera.clear();
  const RigidTransform rig_from_new = change.new_from_rig.Inverse();
  for (CalibratedCamera& camera : moved.cameras) {
    camera.cam_from_rig = camera.cam_from_rig * rig_from_new;
  }
  if (moved.wand_volume) moved.wand_volume = MovedVolume(*moved.wand_volume, change.new_from_rig);
  const auto move_points = [&change](CalibratedTarget* target) {
    for (CalibratedPoint& point : target->static_points) {
      point.position_m = change.new_from_rig * point.position_m;
    }
  };
  move_points(&moved.target);
  for (CalibratedTarget& target : moved.other_targets) move_points(&target);

  moved.camera_covariance.clear();
  for (CalibratedCamera& camera : moved.cameras) camera.uncertainty.reset();
  if (old.matrix.size() == 0) return moved;
  const Eigen::Index old_rows = old.matrix.rows();
  const CameraCovariance layout = UnpackCameraCovariance(moved);  // rows alone
  Eigen::Index rows = 0;
  for (const CameraParameters& camera : layout.cameras) rows += camera.rows();
  Eigen::MatrixXd by_old = Eigen::MatrixXd::Zero(rows, old_rows);
  Eigen::MatrixXd by_change = Eigen::MatrixXd::Zero(rows, 6);
  for (size_t c = 0; c < moved.cameras.size(); ++c) {
    const CameraParameters &from = old.cameras[c], &to = layout.cameras[c];
    const PoseDerivatives derivatives(moved.cameras[c].cam_from_rig, change.new_from_rig);
    if (from.has_pose) by_old.block<6, 6>(to.first_row, from.first_row) = derivatives.by_pose;
    by_change.middleRows<6>(to.first_row) = derivatives.by_change;
    const Eigen::Index count = from.intrinsic_count;
    by_old.block(to.first_row + 6, from.first_row + (from.has_pose ? 6 : 0), count, count)
        .setIdentity();
  }
  if (change.by_parameters.cols() == old_rows) by_old += by_change * change.by_parameters;
  const Eigen::MatrixXd covariance = by_old * old.matrix * by_old.transpose() +
                                     by_change * change.own_covariance * by_change.transpose();
  moved.camera_covariance = PackLowerTriangle(covariance);
  for (size_t c = 0; c < moved.cameras.size(); ++c) {
    CameraUncertainty uncertainty;
    if (calibration.cameras[c].uncertainty) uncertainty = *calibration.cameras[c].uncertainty;
    const Eigen::Index row = layout.cameras[c].first_row;
    SetPoseSigmas(covariance.block<6, 6>(row, row), moved.cameras[c].cam_from_rig, &uncertainty);
    moved.cameras[c].uncertainty = std::move(uncertainty);
  }
  return moved;
}

}  // namespace rigcal
