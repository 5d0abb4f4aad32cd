// SPDX-License-Identifier: Apache-2.0
#include "client/results/rigid_alignment.h"

#include <Eigen/SVD>
#include <algorithm>
#include <utility>

#include "client/output/quantities.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

constexpr double kOrientationWeight = 1e-6;
// Below a micrometre centres are one place, apart only by rounding.
constexpr double kMinSpreadM2 = 1e-12;

Eigen::Vector3d Centre(const RigidTransform& cam_from_frame) {
  return cam_from_frame.SourceFromTargetTranslation();
}

std::pair<Eigen::Vector3d, Eigen::Vector3d> MeanCentres(const std::vector<PosePair>& cameras) {
  Eigen::Vector3d sum_a = Eigen::Vector3d::Zero(), sum_b = Eigen::Vector3d::Zero();
  for (const PosePair& camera : cameras) {
    sum_a += Centre(camera.cam_from_a);
    sum_b += Centre(camera.cam_from_b);
  }
  const auto count = static_cast<double>(cameras.size());
  return {sum_a / count, sum_b / count};
}

bool IsFinite(const RigidTransform& transform) {
  return transform.translation_m.allFinite() && transform.rotation.coeffs().allFinite();
}

}  // namespace

absl::StatusOr<RigidTransform> AlignRigidly(const std::vector<PosePair>& cameras) {
  if (cameras.empty()) return absl::InvalidArgumentError("no camera to align by");
  for (const PosePair& camera : cameras) {
    if (!IsFinite(camera.cam_from_a) || !IsFinite(camera.cam_from_b)) {
      return absl::InvalidArgumentError("a camera's pose is not finite");
    }
  }
  const auto [mean_a, mean_b] = MeanCentres(cameras);
  const auto count = static_cast<double>(cameras.size());

  Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d orientation = Eigen::Matrix3d::Zero();
  double spread_m2 = 0;
  for (const PosePair& camera : cameras) {
    const Eigen::Vector3d a = Centre(camera.cam_from_a) - mean_a;
    const Eigen::Vector3d b = Centre(camera.cam_from_b) - mean_b;
    correlation += b * a.transpose();
    orientation +=
        (camera.cam_from_b.rotation.conjugate() * camera.cam_from_a.rotation).toRotationMatrix();
    spread_m2 += a.squaredNorm() / count;
  }
  correlation += kOrientationWeight * std::max(spread_m2, kMinSpreadM2) * orientation;

  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(correlation,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d reflection = Eigen::Matrix3d::Identity();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) reflection(2, 2) = -1;
  const Eigen::Quaterniond rotation(
      Eigen::Matrix3d(svd.matrixU() * reflection * svd.matrixV().transpose()));
  return RigidTransform(rotation.normalized(), mean_b - rotation.normalized() * mean_a);
}

absl::StatusOr<double> FindScale(const std::vector<PosePair>& cameras) {
  RIGCAL_ASSIGN_OR_RETURN(const RigidTransform b_from_a, AlignRigidly(cameras));
  const auto [mean_a, mean_b] = MeanCentres(cameras);
  double product = 0, square = 0;
  for (const PosePair& camera : cameras) {
    const Eigen::Vector3d a = Centre(camera.cam_from_a) - mean_a;
    product += (Centre(camera.cam_from_b) - mean_b).dot(b_from_a.rotation * a);
    square += a.squaredNorm();
  }
  if (!(square > kMinSpreadM2) || !(product > 0)) {
    return absl::InvalidArgumentError("the camera centres do not tell the scale");
  }
  return product / square;
}

PoseDifference DifferenceAfter(const RigidTransform& b_from_a, const PosePair& camera) {
  const Eigen::Vector3d moved = b_from_a * Centre(camera.cam_from_a);
  const RigidTransform cam_from_b = camera.cam_from_a * b_from_a.Inverse();
  return {
      (moved - Centre(camera.cam_from_b)).norm(),
      DegreesFromRadians(
          Eigen::AngleAxisd(cam_from_b.rotation * camera.cam_from_b.rotation.conjugate()).angle())};
}

}  // namespace rigcal::client
