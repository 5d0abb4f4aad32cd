// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/lens_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/camera/camera_model.h"

namespace rigcal::server {
namespace {

constexpr int kPoseSize = 6;
constexpr int kMaxSteps = 12;
constexpr double kWideLoss = 20;
constexpr double kFirstDamping = 1e-4, kDampingFactor = 10, kMostDamping = 1e6;
constexpr double kSmallDecrease = 1e-6;  // relative change of the cost

// ViewNormal equations of some views: pose, then free intrinsics.
struct ViewNormal {
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient;
  double cost = 0, squares = 0, weights = 0;  // weighted squares, and of how many numbers
  bool visible = true;
};

std::vector<int> FreeIntrinsics(const BundleCamera& camera) {
  std::vector<int> free;
  if (camera.intrinsics_fixed) return free;
  for (int i = 0; i < static_cast<int>(camera.intrinsics.size()); ++i) {
    if (camera.intrinsics_sigma[i] > 0) free.push_back(i);
  }
  return free;
}

ViewNormal Empty(size_t free) {
  const auto size = static_cast<Eigen::Index>(kPoseSize + free);
  return {Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
}

void AddView(const PlacedView& view, const BundleCamera& camera, const std::vector<int>& free,
             double loss_scale, bool with_derivatives, ViewNormal* normal) {
  const auto count = static_cast<Eigen::Index>(view.x_in_rig.size());
  Eigen::VectorXd residual(2 * count);
  Eigen::MatrixXd derivative(2 * count, normal->gradient.size());
  for (Eigen::Index m = 0; m < count; ++m) {
    const Eigen::Vector3d rotated =
        camera.cam_from_rig.rotation * view.x_in_rig[static_cast<size_t>(m)];
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> by_point;
    IntrinsicsJacobian by_intrinsics;
    if (!Project(camera.model, camera.intrinsics.data(),
                 rotated + camera.cam_from_rig.translation_m, &pixel, &by_point, &by_intrinsics)) {
      normal->visible = false;
      return;
    }
    residual.segment<2>(2 * m) = pixel - view.centre_px[static_cast<size_t>(m)];
    if (!with_derivatives) continue;
    auto rows = derivative.middleRows<2>(2 * m);
    for (int i = 0; i < 3; ++i) {
      rows.col(i) = by_point * Eigen::Vector3d::Unit(i).cross(rotated);
      rows.col(3 + i) = by_point.col(i);
    }
    for (size_t i = 0; i < free.size(); ++i) {
      rows.col(kPoseSize + static_cast<Eigen::Index>(i)) = by_intrinsics.col(free[i]);
    }
  }
  residual = view.whitening * residual;
  // Cauchy's loss of the whole view, whose markers have their errors in common.
  const double scale2 = loss_scale * loss_scale * static_cast<double>(count);
  const double square = residual.squaredNorm();
  const double weight = 1 / (1 + square / scale2);
  normal->cost += 0.5 * scale2 * std::log1p(square / scale2);
  normal->squares += weight * square;
  normal->weights += weight * static_cast<double>(2 * count);
  if (!with_derivatives) return;
  derivative = view.whitening * derivative;
  normal->information.noalias() += weight * derivative.transpose() * derivative;
  normal->gradient.noalias() += weight * derivative.transpose() * residual;
}

void AddPriors(const BundleCamera& camera, const std::vector<int>& free, ViewNormal* normal) {
  for (size_t i = 0; i < free.size(); ++i) {
    const double sigma = camera.intrinsics_sigma[free[i]];
    const double off = (camera.intrinsics[free[i]] - camera.intrinsics_mean[free[i]]) / sigma;
    const auto at = kPoseSize + static_cast<Eigen::Index>(i);
    normal->cost += 0.5 * off * off;
    normal->information(at, at) += 1 / (sigma * sigma);
    normal->gradient[at] += off / sigma;
  }
}

ViewNormal NormalOf(const std::vector<PlacedView>& views, const BundleCamera& camera,
                    const std::vector<int>& free, double loss_scale, bool with_derivatives) {
  ViewNormal normal = Empty(free.size());
  for (const PlacedView& view : views) {
    AddView(view, camera, free, loss_scale, with_derivatives, &normal);
    if (!normal.visible) return normal;
  }
  AddPriors(camera, free, &normal);
  return normal;
}

BundleCamera MovedBy(BundleCamera camera, const std::vector<int>& free,
                     const Eigen::VectorXd& step) {
  const Eigen::Vector3d turn = step.head<3>();
  const double angle = turn.norm();
  if (angle > 0) {
    camera.cam_from_rig.rotation =
        (Eigen::AngleAxisd(angle, turn / angle) * camera.cam_from_rig.rotation).normalized();
  }
  camera.cam_from_rig.translation_m += step.segment<3>(3);
  for (size_t i = 0; i < free.size(); ++i) {
    camera.intrinsics[free[i]] += step[kPoseSize + static_cast<Eigen::Index>(i)];
  }
  return camera;
}

// Cholesky of the matrix with a unit diagonal, which pixels share with radians.
class ScaledFactor {
 public:
  explicit ScaledFactor(const Eigen::MatrixXd& information, double damping = 0)
      : scale_(information.diagonal().cwiseSqrt().cwiseInverse()) {
    Eigen::MatrixXd scaled = scale_.asDiagonal() * information * scale_.asDiagonal();
    scaled.diagonal().array() += damping;
    factor_.compute(scaled);
    ok_ = scale_.allFinite() && factor_.info() == Eigen::Success;
  }
  bool ok() const { return ok_; }
  Eigen::MatrixXd Solve(const Eigen::MatrixXd& right) const {
    return scale_.asDiagonal() * factor_.solve(scale_.asDiagonal() * right);
  }

 private:
  Eigen::VectorXd scale_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  bool ok_ = false;
};

// Levenberg-Marquardt from `camera`; false where it cannot begin.
bool Minimise(const std::vector<PlacedView>& views, const std::vector<int>& free, double loss_scale,
              BundleCamera* camera) {
  ViewNormal normal = NormalOf(views, *camera, free, loss_scale, true);
  double damping = kFirstDamping;
  for (int step = 0; step < kMaxSteps && damping < kMostDamping; ++step) {
    if (!normal.visible) return false;
    const ScaledFactor factor(normal.information, damping);
    if (!factor.ok()) return false;
    const BundleCamera moved = MovedBy(*camera, free, -factor.Solve(normal.gradient));
    ViewNormal after = NormalOf(views, moved, free, loss_scale, true);
    if (!after.visible || !(after.cost < normal.cost)) {
      if (after.visible && after.cost <= (1 + kSmallDecrease) * normal.cost) break;
      damping *= kDampingFactor;
      continue;
    }
    const bool is_small = normal.cost - after.cost < kSmallDecrease * normal.cost;
    *camera = moved;
    normal = std::move(after);
    damping /= kDampingFactor;
    if (is_small) break;
  }
  return normal.visible;
}

// Infinite where a marker is not visible.
double MeanErrorPx(const std::vector<PlacedView>& views, size_t begin, size_t end,
                   const BundleCamera& camera) {
  double sum_px = 0;
  size_t count = 0;
  for (size_t v = begin; v < end; ++v) {
    for (size_t m = 0; m < views[v].x_in_rig.size(); ++m) {
      Eigen::Vector2d pixel;
      if (!Project(camera.model, camera.intrinsics.data(),
                   camera.cam_from_rig * views[v].x_in_rig[m], &pixel, nullptr, nullptr)) {
        return std::numeric_limits<double>::infinity();
      }
      sum_px += (pixel - views[v].centre_px[m]).norm();
      ++count;
    }
  }
  return sum_px / static_cast<double>(std::max<size_t>(1, count));
}

}  // namespace

double LensFit::IntrinsicSigma(int i) const {
  return std::sqrt(std::max(0.0, covariance(kPoseSize + i, kPoseSize + i)));
}

bool FitLens(const std::vector<PlacedView>& views, const BundleCamera& camera,
             const LensFitOptions& options, LensFit* fit) {
  const std::vector<int> free = FreeIntrinsics(camera);
  fit->camera = camera;
  if (views.empty()) return false;
  if (options.from_afar && !Minimise(views, free, kWideLoss * options.loss_scale, &fit->camera)) {
    return false;
  }
  if (!Minimise(views, free, options.loss_scale, &fit->camera)) return false;
  const ViewNormal normal = NormalOf(views, fit->camera, free, options.loss_scale, true);
  const ScaledFactor factor(normal.information);
  if (!normal.visible || !factor.ok()) return false;
  const auto size = normal.gradient.size();
  const double variance = std::max(1.0, normal.squares / std::max(1.0, normal.weights));
  const Eigen::MatrixXd own = variance * factor.Solve(Eigen::MatrixXd::Identity(size, size));
  std::vector<Eigen::Index> rows = {0, 1, 2, 3, 4, 5};
  for (const int i : free) rows.push_back(kPoseSize + i);
  const Eigen::Index all = kPoseSize + camera.intrinsics.size();
  fit->covariance = Eigen::MatrixXd::Zero(all, all);
  fit->covariance(rows, rows) = own;
  return true;
}

std::vector<double> HeldOutErrorsPx(const std::vector<PlacedView>& views,
                                    const BundleCamera& camera, int groups) {
  LensFit fit;
  const LensFitOptions options;
  if (groups < 2 || !FitLens(views, camera, options, &fit)) return {};
  const std::vector<int> free = FreeIntrinsics(camera);
  const ViewNormal all = NormalOf(views, fit.camera, free, options.loss_scale, true);
  std::vector<double> errors_px;
  for (size_t group = 0; group < static_cast<size_t>(groups); ++group) {
    const size_t begin = views.size() * group / static_cast<size_t>(groups);
    const size_t end = views.size() * (group + 1) / static_cast<size_t>(groups);
    ViewNormal own = Empty(free.size());
    for (size_t v = begin; v < end; ++v) {
      AddView(views[v], fit.camera, free, options.loss_scale, true, &own);
    }
    const ScaledFactor factor(all.information - own.information);
    if (!factor.ok()) {
      errors_px.push_back(std::numeric_limits<double>::infinity());
      continue;
    }
    const BundleCamera without =
        MovedBy(fit.camera, free, -factor.Solve(all.gradient - own.gradient));
    errors_px.push_back(MeanErrorPx(views, begin, end, without));
  }
  return errors_px;
}

}  // namespace rigcal::server
