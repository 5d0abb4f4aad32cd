// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/point_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "common/camera/camera_model.h"

namespace rigcal {
namespace {

constexpr double kMinSinBetweenRays = 1e-3;
constexpr int kFitSteps = 10;
constexpr double kFitEnoughM = 1e-10;

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

// The point nearest all rays, by the sum of squared distances.
std::optional<Eigen::Vector3d> NearestRays(const std::vector<CalibratedCamera>& cameras,
                                           const std::vector<PixelView>& views) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero(), first = Eigen::Vector3d::Zero();
  double widest = 0;
  for (const PixelView& view : views) {
    const CalibratedCamera& camera = cameras[static_cast<size_t>(view.camera)];
    const absl::StatusOr<Eigen::Vector2d> ray = Undistort(camera.intrinsics, view.centre_px);
    if (!ray.ok()) return std::nullopt;
    const Eigen::Vector3d bearing = camera.cam_from_rig.rotation.conjugate() *
                                    Eigen::Vector3d(ray->x(), ray->y(), 1).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - bearing * bearing.transpose();
    normal += across;
    right += across * camera.cam_from_rig.SourceFromTargetTranslation();
    if (first.isZero()) first = bearing;
    widest = std::max(widest, first.cross(bearing).norm());
  }
  if (!(widest > kMinSinBetweenRays)) return std::nullopt;
  return normal.ldlt().solve(right);
}

struct Linearised {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
};

}  // namespace

double FittedPoint::WorstSigmas() const {
  return residual_sigmas.empty() ? 0 : *std::ranges::max_element(residual_sigmas);
}

double FittedPoint::RmsPx() const {
  double sum = 0;
  for (const Eigen::Vector2d& residual : residual_px) sum += residual.squaredNorm();
  return residual_px.empty() ? 0 : std::sqrt(sum / static_cast<double>(residual_px.size()));
}

std::optional<FittedPoint> FitPoint(const std::vector<CalibratedCamera>& cameras,
                                    const std::vector<PixelView>& views) {
  if (views.size() < 2) return std::nullopt;
  const std::optional<Eigen::Vector3d> nearest = NearestRays(cameras, views);
  if (!nearest) return std::nullopt;
  FittedPoint point;
  point.position_m = *nearest;
  point.residual_px.resize(views.size());
  point.residual_sigmas.resize(views.size());
  // Fills the residuals, too. False: a camera does not see the point.
  const auto linearise = [&](Linearised* out) {
    for (size_t i = 0; i < views.size(); ++i) {
      const CalibratedCamera& camera = cameras[static_cast<size_t>(views[i].camera)];
      Eigen::Vector2d pixel;
      Eigen::Matrix<double, 2, 3> d_cam;
      if (!Project(camera.intrinsics, camera.cam_from_rig * point.position_m, &pixel, &d_cam)) {
        return false;
      }
      const Eigen::Matrix<double, 2, 3> jacobian =
          d_cam * camera.cam_from_rig.rotation.toRotationMatrix();
      const Eigen::Matrix2d weight = views[i].covariance_px2.inverse();
      const Eigen::Vector2d residual = pixel - views[i].centre_px;
      point.residual_px[i] = residual;
      point.residual_sigmas[i] = std::sqrt(std::max(0.0, residual.dot(weight * residual)));
      out->normal += jacobian.transpose() * weight * jacobian;
      out->gradient += jacobian.transpose() * weight * residual;
    }
    return true;
  };
  for (int step = 0;; ++step) {
    Linearised all;
    if (!linearise(&all)) return std::nullopt;
    const Eigen::LDLT<Eigen::Matrix3d> factor(all.normal);
    const Eigen::Vector3d delta = -factor.solve(all.gradient);
    if (!delta.allFinite()) return std::nullopt;
    if (step == kFitSteps || delta.norm() < kFitEnoughM) {
      point.noise_m2 = factor.solve(Eigen::Matrix3d::Identity());
      if (!point.noise_m2.allFinite()) return std::nullopt;
      return point;
    }
    point.position_m += delta;
  }
}

Eigen::Matrix3Xd PointGain(const std::vector<CalibratedCamera>& cameras,
                           const CameraCovariance& covariance, const std::vector<PixelView>& views,
                           const FittedPoint& point) {
  Eigen::Matrix3Xd pull = Eigen::Matrix3Xd::Zero(3, covariance.matrix.rows());
  for (const PixelView& view : views) {
    const CalibratedCamera& camera = cameras[static_cast<size_t>(view.camera)];
    const CameraParameters& rows = covariance.cameras[static_cast<size_t>(view.camera)];
    if (rows.rows() == 0) continue;
    const Eigen::Matrix3d rotation = camera.cam_from_rig.rotation.toRotationMatrix();
    const Eigen::Vector3d rotated = rotation * point.position_m;
    const IntrinsicsVector intrinsics = ToVector(camera.intrinsics);
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> d_cam;
    IntrinsicsJacobian d_intrinsics;
    if (!Project(camera.intrinsics.model, intrinsics.data(),
                 rotated + camera.cam_from_rig.translation_m, &pixel, &d_cam, &d_intrinsics)) {
      continue;
    }
    const Eigen::Matrix<double, 3, 2> weighted =
        (d_cam * rotation).transpose() * view.covariance_px2.inverse();
    Eigen::Index row = rows.first_row;
    if (rows.has_pose) {
      pull.middleCols<3>(row) -= weighted * d_cam * CrossMatrix(rotated);
      pull.middleCols<3>(row + 3) += weighted * d_cam;
      row += 6;
    }
    if (rows.intrinsic_count > 0) {
      pull.middleCols(row, rows.intrinsic_count) += weighted * d_intrinsics;
    }
  }
  return -point.noise_m2 * pull;
}

}  // namespace rigcal
