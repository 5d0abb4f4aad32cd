// SPDX-License-Identifier: Apache-2.0
#include "common/camera/fit_intrinsics.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"

namespace rigcal {
namespace {

constexpr int kMaxFitSteps = 200;
constexpr double kMaxFitDamping = 1e12;
constexpr double kFitTolerance = 1e-12;  // relative change of the cost

// Sum of squares; infinite where a ray is not seen.
double FitCost(DistortionModel model, const std::vector<RayPixel>& rays,
               const IntrinsicsVector& values) {
  double cost = 0;
  for (const RayPixel& ray : rays) {
    Eigen::Vector2d pixel;
    if (!Project(model, values.data(), ray.direction, &pixel, nullptr, nullptr)) {
      return std::numeric_limits<double>::infinity();
    }
    cost += (pixel - ray.pixel).squaredNorm();
  }
  return cost;
}

IntrinsicsVector StartValues(DistortionModel model, const Intrinsics& start) {
  IntrinsicsVector values = IntrinsicsVector::Zero(IntrinsicsSize(model));
  const IntrinsicsVector given = ToVector(start);
  const bool same_family =
      (model == DistortionModel::kFisheye) == (start.model == DistortionModel::kFisheye);
  // Brown-Conrady is the rational model without its last coefficients.
  const Eigen::Index count = same_family ? std::min(values.size(), given.size()) : 4;
  values.head(count) = given.head(count);
  return values;
}

}  // namespace

absl::StatusOr<IntrinsicsFit> FitIntrinsics(DistortionModel model,
                                            const std::vector<RayPixel>& rays,
                                            const Intrinsics& start, const Eigen::MatrixXd& basis) {
  IntrinsicsVector values = StartValues(model, start);
  const Eigen::Index size = values.size();
  if (2 * static_cast<Eigen::Index>(rays.size()) < size) {
    return absl::InvalidArgumentError(
        absl::StrCat("intrinsics: ", rays.size(), " rays are too few to fit a lens to"));
  }
  // All are free, or the nearest of those that the basis has begin.
  const Eigen::MatrixXd free = basis.size() > 0 ? basis : Eigen::MatrixXd::Identity(size, size);
  const auto in_basis = [&free, &basis](const IntrinsicsVector& any) -> IntrinsicsVector {
    if (basis.size() == 0) return any;
    return free * (free.transpose() * free).ldlt().solve(free.transpose() * any);
  };
  values = in_basis(values);
  double cost = FitCost(model, rays, values);
  if (!std::isfinite(cost)) {
    values.tail(size - 4).setZero();
    cost = FitCost(model, rays, values);
  }
  double damping = 1e-3;
  for (int step = 0; step < kMaxFitSteps && damping < kMaxFitDamping; ++step) {
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size);
    for (const RayPixel& ray : rays) {
      Eigen::Vector2d pixel;
      IntrinsicsJacobian jacobian;
      if (!Project(model, values.data(), ray.direction, &pixel, nullptr, &jacobian)) continue;
      information += jacobian.transpose() * jacobian;
      gradient += jacobian.transpose() * (pixel - ray.pixel);
    }
    const double before = cost;
    for (; damping < kMaxFitDamping; damping *= 10) {
      Eigen::MatrixXd damped = free.transpose() * information * free;
      damped.diagonal() *= 1 + damping;
      const IntrinsicsVector next =
          values - free * damped.ldlt().solve(free.transpose() * gradient);
      const double next_cost =
          next.allFinite() ? FitCost(model, rays, next) : std::numeric_limits<double>::infinity();
      if (!(next_cost < cost)) continue;
      values = next;
      cost = next_cost;
      damping = std::max(1e-12, 0.1 * damping);
      break;
    }
    if (!(before - cost > kFitTolerance * before)) break;
  }
  if (!std::isfinite(cost) || !(values[0] > 0) || !(values[1] > 0)) {
    return absl::FailedPreconditionError("intrinsics: no lens of this model shows these rays");
  }
  return IntrinsicsFit{FromVector(model, values),
                       std::sqrt(cost / static_cast<double>(rays.size()))};
}

}  // namespace rigcal
