// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"
#include "common/lens/lens_difference.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal {
namespace {

constexpr double kLeastPivot = 1e-13;  // of an information matrix with ones in its diagonal

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

LensSensitivity::LensSensitivity(LensModel model, const Intrinsics& intrinsics,
                                 const ImageSize& image_size_px, int stride) {
  const int free = FreeIntrinsics(model);
  const IntrinsicsVector values = ToVector(intrinsics);
  std::vector<Eigen::Matrix<double, 2, 3>> d_turns;
  Eigen::Matrix3d information = 1e-9 * Eigen::Matrix3d::Identity();
  Eigen::MatrixXd coupling = Eigen::MatrixXd::Zero(3, free);
  for (int row = 0; row < LensDifference::kRows; row += stride) {
    for (int column = 0; column < LensDifference::kColumns; column += stride) {
      has_ray_.push_back(false);
      const absl::StatusOr<Eigen::Vector2d> ray =
          Undistort(intrinsics, LensDifference::GridPixel(image_size_px, row, column));
      if (!ray.ok()) continue;
      const Eigen::Vector3d direction = Eigen::Vector3d(ray->x(), ray->y(), 1).normalized();
      Eigen::Vector2d pixel;
      Eigen::Matrix<double, 2, 3> d_point;
      IntrinsicsJacobian d_intrinsics;
      if (!Project(intrinsics.model, values.data(), direction, &pixel, &d_point, &d_intrinsics)) {
        continue;
      }
      has_ray_.back() = true;
      Eigen::Matrix<double, 2, 3> d_turn;
      for (int k = 0; k < 3; ++k) {
        d_turn.col(k) = d_point * Eigen::Vector3d::Unit(k).cross(direction);
      }
      d_turns.push_back(d_turn);
      d_pixels_.emplace_back(d_intrinsics.leftCols(free));
      information += d_turn.transpose() * d_turn;
      coupling += d_turn.transpose() * d_pixels_.back();
    }
  }
  // The turn that follows the intrinsics.
  const Eigen::MatrixXd turn = -information.ldlt().solve(coupling);
  mean_square_ = Eigen::MatrixXd::Zero(free, free);
  for (size_t i = 0; i < d_pixels_.size(); ++i) {
    d_pixels_[i] += d_turns[i] * turn;
    mean_square_ += d_pixels_[i].transpose() * d_pixels_[i] / static_cast<double>(d_pixels_.size());
  }
}

LensUncertainty LensSensitivity::Of(const Eigen::MatrixXd& covariance) const {
  LensUncertainty uncertainty;
  std::vector<double> sigmas;
  auto d_pixel = d_pixels_.begin();
  for (const bool has_ray : has_ray_) {
    double& sigma = uncertainty.map_px.emplace_back(std::numeric_limits<double>::quiet_NaN());
    if (!has_ray) continue;
    if (covariance.size() == 0) {
      sigma = kInfinity;
    } else {
      const double variance = (*d_pixel * covariance).cwiseProduct(*d_pixel).sum();
      sigma = std::sqrt(std::max(0.0, variance));
    }
    sigmas.push_back(sigma);
    ++d_pixel;
  }
  const bool is_known = covariance.size() > 0 && !sigmas.empty();
  uncertainty.median_px = is_known ? InterpolatedQuantile(sigmas, 0.5) : kInfinity;
  uncertainty.p95_px = is_known ? InterpolatedQuantile(std::move(sigmas), 0.95) : kInfinity;
  return uncertainty;
}

double LensSensitivity::MeanVariance(const Eigen::MatrixXd& covariance) const {
  if (covariance.size() == 0 || d_pixels_.empty()) return kInfinity;
  return covariance.cwiseProduct(mean_square_).sum();
}

Eigen::MatrixXd CovarianceOf(const Eigen::MatrixXd& information) {
  const Eigen::VectorXd diagonal = information.diagonal();
  if (!(diagonal.size() > 0 && diagonal.minCoeff() > 0 && information.allFinite())) return {};
  const Eigen::VectorXd scale = diagonal.cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::LDLT<Eigen::MatrixXd> factor(scaled);
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > kLeastPivot)) return {};
  const Eigen::MatrixXd inverse =
      factor.solve(Eigen::MatrixXd::Identity(information.rows(), information.cols()));
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

}  // namespace rigcal
