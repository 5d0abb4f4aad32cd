// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/pose_covariance.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "common/camera/intrinsics_vector.h"

namespace rigcal::server {

int RigPoses::Find(const std::string& camera) const {
  const auto found = std::ranges::find(cameras, camera);
  return found == cameras.end() ? -1 : static_cast<int>(found - cameras.begin());
}

absl::StatusOr<RigPoses> PosesOf(const CalibrationResult& calibration,
                                 const std::vector<std::string>& given, LensRows lens_rows) {
  if (!calibration.scale_known) {
    return absl::FailedPreconditionError("the calibration has no known scale");
  }
  RigPoses poses;
  poses.scale_sigma_rel = calibration.target.scale_sigma_rel;
  std::vector<Eigen::Index> rows;      // in the packed covariance, of each pose row; -1: none
  std::vector<Eigen::Index> lenses;    // likewise, of the intrinsics that are exact
  std::vector<Eigen::Index> own_rows;  // of RigPoses::lenses
  Eigen::Index count = 0;
  for (const CalibratedCamera& camera : calibration.cameras) {
    poses.cameras.push_back(camera.camera);
    poses.cam_from_rig.push_back(camera.cam_from_rig);
    const bool is_reference = camera.camera == calibration.reference_camera;
    for (int i = 0; i < 6; ++i) rows.push_back(is_reference ? -1 : count++);
    if (!camera.intrinsics_refined) continue;
    const bool is_given = std::ranges::find(given, camera.camera) != given.end();
    const IntrinsicsVector values = ToVector(camera.intrinsics);
    for (Eigen::Index i = 0; i < values.size(); ++i, ++count) {
      if (is_given) lenses.push_back(count);
      if (is_given || lens_rows != LensRows::kOwn) continue;
      own_rows.push_back(count);
      poses.lenses.push_back({camera.camera, static_cast<int>(i), values[i]});
    }
  }
  const std::vector<double>& packed = calibration.camera_covariance;
  if (packed.size() != static_cast<size_t>(count * (count + 1) / 2) || count == 0) {
    return absl::FailedPreconditionError(
        "the calibration keeps no covariance of its cameras: it was made by an older version, or "
        "its data do not determine every parameter; calibrate its sessions again");
  }
  const auto value = [&packed](Eigen::Index i, Eigen::Index j) {
    const auto [low, high] = std::minmax(i, j);
    return low < 0 ? 0.0 : packed[static_cast<size_t>(high * (high + 1) / 2 + low)];
  };
  const auto block = [&value](const std::vector<Eigen::Index>& a,
                              const std::vector<Eigen::Index>& b) {
    Eigen::MatrixXd part(static_cast<Eigen::Index>(a.size()), static_cast<Eigen::Index>(b.size()));
    for (Eigen::Index i = 0; i < part.rows(); ++i) {
      for (Eigen::Index j = 0; j < part.cols(); ++j) {
        part(i, j) = value(a[static_cast<size_t>(i)], b[static_cast<size_t>(j)]);
      }
    }
    return part;
  };
  // Those that were held have no variance.
  std::erase_if(lenses, [&value](Eigen::Index row) { return !(value(row, row) > 0); });
  rows.insert(rows.end(), own_rows.begin(), own_rows.end());
  poses.covariance = block(rows, rows);
  if (lenses.empty()) return poses;
  const Eigen::MatrixXd own = block(lenses, lenses), cross = block(rows, lenses);
  // Focal lengths and distortion coefficients are of very different size.
  const Eigen::VectorXd scale = own.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LDLT<Eigen::MatrixXd> factor(
      Eigen::MatrixXd(scale.asDiagonal() * own * scale.asDiagonal()));
  const Eigen::MatrixXd scaled = cross * scale.asDiagonal();
  poses.covariance -= scaled * factor.solve(scaled.transpose());
  return poses;
}

void HoldFixed(size_t camera, RigPoses* poses) {
  const Eigen::Index size = poses->covariance.rows();
  const auto own = static_cast<Eigen::Index>(6 * camera);
  Eigen::MatrixXd change = Eigen::MatrixXd::Identity(size, size);
  for (size_t c = 0; c < poses->cameras.size(); ++c) {
    const Eigen::Matrix3d turn =
        (poses->cam_from_rig[c].rotation * poses->cam_from_rig[camera].rotation.conjugate())
            .toRotationMatrix();
    const auto row = static_cast<Eigen::Index>(6 * c);
    change.block<3, 3>(row, own) -= turn;
    change.block<3, 3>(row + 3, own + 3) -= turn;
  }
  poses->covariance = change * poses->covariance * change.transpose();
}

void MoveToFrameOf(size_t camera, const RigidTransform& cam_from_rig, RigPoses* poses) {
  const RigidTransform old_from_new = poses->cam_from_rig[camera].Inverse() * cam_from_rig;
  const Eigen::Index size = poses->covariance.rows();
  // t' = R t_old_from_new + t: a turn of the camera moves its translation in the new frame, too.
  Eigen::MatrixXd change = Eigen::MatrixXd::Identity(size, size);
  for (size_t c = 0; c < poses->cameras.size(); ++c) {
    RigidTransform& pose = poses->cam_from_rig[c];
    const Eigen::Vector3d arm_m = pose.rotation * old_from_new.translation_m;
    const auto row = static_cast<Eigen::Index>(6 * c);
    Eigen::Matrix3d cross;
    cross << 0, -arm_m.z(), arm_m.y(), arm_m.z(), 0, -arm_m.x(), -arm_m.y(), arm_m.x(), 0;
    change.block<3, 3>(row + 3, row) = -cross;
    pose = pose * old_from_new;
  }
  poses->covariance = change * poses->covariance * change.transpose();
}

}  // namespace rigcal::server
