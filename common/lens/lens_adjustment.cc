// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_adjustment.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"

namespace rigcal {
namespace {

constexpr double kLeastDamping = 1e-12;
constexpr double kMostDamping = 1e10;
constexpr double kConverged = 1e-12;  // relative change of the cost
constexpr double kLeastDiagonal = 1e-9;

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

// A view's part of the normal equations: pose and intrinsics.
struct ViewBlock {
  Matrix6 pose = Matrix6::Zero();
  Vector6 pose_gradient = Vector6::Zero();
  Eigen::MatrixXd coupling;  // 6 x what all views share
};

struct NormalEquations {
  std::vector<ViewBlock> views;
  Eigen::MatrixXd shared;  // free intrinsics, and the bend
  Eigen::VectorXd gradient;
};

double Loss(double squared, double loss_px) {
  if (loss_px <= 0) return squared;
  const double width = loss_px * loss_px;
  return width * std::log1p(squared / width);
}

double LossWeight(double squared, double loss_px) {
  return loss_px <= 0 ? 1.0 : 1.0 / (1.0 + squared / (loss_px * loss_px));
}

// Of the squares of intrinsics, px^2; empty: there are no priors.
Eigen::VectorXd PriorWeights(const LensEstimate& estimate) {
  if (estimate.model != LensModel::kPinhole8 || !(estimate.noise_px > 0)) return {};
  // fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(FreeIntrinsics(estimate.model));
  for (const int radial : {4, 5, 8, 9, 10, 11}) {
    weights[radial] = std::pow(estimate.noise_px / kRationalSigma, 2);
  }
  return weights;
}

double CostOf(const std::vector<BoardView>& flat, const LensEstimate& estimate, double loss_px) {
  const bool is_bent = !estimate.bend_per_m.isZero(0);
  const std::vector<BoardView> bent =
      is_bent ? Bent(flat, estimate.bend_per_m) : std::vector<BoardView>();
  const std::vector<BoardView>& views = is_bent ? bent : flat;
  double cost = 0;
  const IntrinsicsVector values = ToVector(estimate.intrinsics);
  const Eigen::VectorXd weights = PriorWeights(estimate);
  for (Eigen::Index i = 0; i < weights.size(); ++i) cost += weights[i] * values[i] * values[i];
  for (size_t i = 0; i < views.size(); ++i) {
    for (const double error :
         CornerErrors(views[i], estimate.intrinsics, estimate.cam_from_board[i])) {
      cost += Loss(error * error, loss_px);
    }
  }
  return cost;
}

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

// `free` intrinsics, and behind them the bend, if it is estimated.
NormalEquations Linearise(const std::vector<BoardView>& flat, const LensEstimate& estimate,
                          int free, bool estimate_bend, double loss_px) {
  const std::vector<BoardView> views = Bent(flat, estimate.bend_per_m);
  const Eigen::Vector2d middle_m = MiddleOfBoard(flat);
  const int shared = free + (estimate_bend ? 2 : 0);
  const DistortionModel model = estimate.intrinsics.model;
  const IntrinsicsVector values = ToVector(estimate.intrinsics);
  NormalEquations equations;
  equations.views.resize(views.size());
  equations.shared = Eigen::MatrixXd::Zero(shared, shared);
  equations.gradient = Eigen::VectorXd::Zero(shared);
  Eigen::Matrix<double, 2, Eigen::Dynamic> jacobian(2, shared);
  for (size_t i = 0; i < views.size(); ++i) {
    ViewBlock& block = equations.views[i];
    block.coupling = Eigen::MatrixXd::Zero(6, shared);
    const RigidTransform& pose = estimate.cam_from_board[i];
    const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
    for (const BoardCorner& corner : views[i].corners) {
      const Eigen::Vector3d turned = rotation * corner.x_in_board_m;
      Eigen::Vector2d pixel;
      Eigen::Matrix<double, 2, 3> d_point;
      IntrinsicsJacobian d_intrinsics;
      if (!Project(model, values.data(), turned + pose.translation_m, &pixel, &d_point,
                   &d_intrinsics)) {
        continue;
      }
      const Eigen::Vector2d error = pixel - corner.pixel;
      const double weight = LossWeight(error.squaredNorm(), loss_px);
      Eigen::Matrix<double, 2, 6> d_pose;
      d_pose << -d_point * Cross(turned), d_point;
      block.pose += weight * d_pose.transpose() * d_pose;
      block.pose_gradient += weight * d_pose.transpose() * error;
      if (shared == 0) continue;
      jacobian.leftCols(free) = d_intrinsics.leftCols(free);
      if (estimate_bend) {
        const Eigen::Array2d from_middle_m = corner.x_in_board_m.head<2>() - middle_m;
        const Eigen::Vector2d by_height = d_point * rotation.col(2);
        jacobian.rightCols<2>() = by_height * from_middle_m.square().matrix().transpose();
      }
      block.coupling += weight * d_pose.transpose() * jacobian;
      equations.shared += weight * jacobian.transpose() * jacobian;
      equations.gradient += weight * jacobian.transpose() * error;
    }
  }
  const Eigen::VectorXd weights = PriorWeights(estimate);
  if (free > 0 && weights.size() > 0) {
    equations.shared.diagonal().head(free) += weights;
    equations.gradient.head(free) += weights.cwiseProduct(values.head(free));
  }
  return equations;
}

template <typename Matrix>
void Damp(double damping, Matrix* matrix) {
  for (Eigen::Index i = 0; i < matrix->rows(); ++i) {
    (*matrix)(i, i) += damping * std::max((*matrix)(i, i), kLeastDiagonal);
  }
}

// The equations of what the views share, without the poses.
void EliminatePoses(const NormalEquations& equations, double damping, Eigen::MatrixXd* information,
                    Eigen::VectorXd* gradient) {
  *information = equations.shared;
  if (damping > 0) Damp(damping, information);
  *gradient = equations.gradient;
  for (const ViewBlock& block : equations.views) {
    Matrix6 pose = block.pose;
    Damp(std::max(damping, kLeastDamping), &pose);
    const Eigen::LDLT<Matrix6> factor(pose);
    *information -= block.coupling.transpose() * factor.solve(block.coupling);
    *gradient -= block.coupling.transpose() * factor.solve(block.pose_gradient);
  }
}

// The estimate after one damped step.
LensEstimate Stepped(const LensEstimate& estimate, const NormalEquations& equations, int free,
                     double damping) {
  LensEstimate next = estimate;
  const Eigen::Index shared = equations.gradient.size();
  Eigen::VectorXd step = Eigen::VectorXd::Zero(shared);
  if (shared > 0) {
    Eigen::MatrixXd information;
    Eigen::VectorXd gradient;
    EliminatePoses(equations, damping, &information, &gradient);
    step = -information.ldlt().solve(gradient);
    IntrinsicsVector values = ToVector(estimate.intrinsics);
    values.head(free) += step.head(free);
    next.intrinsics = FromVector(estimate.intrinsics.model, values);
    if (shared > free) next.bend_per_m += step.tail<2>();
  }
  for (size_t i = 0; i < equations.views.size(); ++i) {
    const ViewBlock& block = equations.views[i];
    Matrix6 pose = block.pose;
    Damp(damping, &pose);
    Vector6 right = block.pose_gradient;
    if (shared > 0) right += block.coupling * step;
    const Vector6 move = -pose.ldlt().solve(right);
    const Eigen::Vector3d turn = move.head<3>();
    const double angle = turn.norm();
    RigidTransform& to = next.cam_from_board[i];
    if (angle > 0) {
      to.rotation =
          (Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle)) * to.rotation).normalized();
    }
    to.translation_m += move.tail<3>();
  }
  return next;
}

bool IsUsable(const LensEstimate& estimate) {
  return ToVector(estimate.intrinsics).allFinite() && estimate.intrinsics.fx_px > 0 &&
         estimate.intrinsics.fy_px > 0;
}

}  // namespace

Eigen::Vector2d MiddleOfBoard(const std::vector<BoardView>& views) {
  Eigen::Vector2d low_m = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high_m = -low_m;
  for (const BoardView& view : views) {
    for (const BoardCorner& corner : view.corners) {
      low_m = low_m.cwiseMin(corner.x_in_board_m.head<2>());
      high_m = high_m.cwiseMax(corner.x_in_board_m.head<2>());
    }
  }
  return 0.5 * (low_m + high_m);
}

std::vector<BoardView> Bent(const std::vector<BoardView>& views,
                            const Eigen::Vector2d& bend_per_m) {
  const Eigen::Array2d middle_m = MiddleOfBoard(views);
  std::vector<BoardView> bent = views;
  for (BoardView& view : bent) {
    for (BoardCorner& corner : view.corners) {
      const Eigen::Array2d from_middle_m = corner.x_in_board_m.head<2>().array() - middle_m;
      corner.x_in_board_m.z() += bend_per_m.dot(from_middle_m.square().matrix());
    }
  }
  return bent;
}

std::vector<double> CornerErrors(const BoardView& view, const Intrinsics& intrinsics,
                                 const RigidTransform& cam_from_board) {
  std::vector<double> errors;
  errors.reserve(view.corners.size());
  for (const BoardCorner& corner : view.corners) {
    Eigen::Vector2d pixel;
    const bool seen = Project(intrinsics, cam_from_board * corner.x_in_board_m, &pixel);
    const double error = seen ? (pixel - corner.pixel).norm() : kUnseenPx;
    errors.push_back(error < kUnseenPx ? error : kUnseenPx);
  }
  return errors;
}

LensAdjustment AdjustLens(const std::vector<BoardView>& views, const LensEstimate& start,
                          const LensAdjustmentOptions& options) {
  const int free = options.fix_intrinsics ? 0 : FreeIntrinsics(start.model);
  LensAdjustment result;
  result.estimate = start;
  // A step may not leave out coefficients that Validate wants.
  result.estimate.intrinsics = FromVector(start.intrinsics.model, ToVector(start.intrinsics));
  result.cost_px2 = CostOf(views, result.estimate, options.loss_px);
  double damping = 1e-4;
  NormalEquations equations =
      Linearise(views, result.estimate, free, options.estimate_bend, options.loss_px);
  for (int step = 0; step < options.max_steps; ++step) {
    const double before = result.cost_px2;
    bool better = false;
    for (; damping < kMostDamping && !better; damping *= 10) {
      LensEstimate next = Stepped(result.estimate, equations, free, damping);
      if (!IsUsable(next)) continue;
      const double cost = CostOf(views, next, options.loss_px);
      if (!(cost < before)) continue;
      result.estimate = std::move(next);
      result.cost_px2 = cost;
      better = true;
    }
    if (!better) break;
    damping = std::max(damping / 100, kLeastDamping);  // the loop has raised it once more
    equations = Linearise(views, result.estimate, free, options.estimate_bend, options.loss_px);
    if (before - result.cost_px2 < kConverged * before) break;
  }
  if (equations.gradient.size() > 0) {
    Eigen::VectorXd gradient;
    EliminatePoses(equations, 0, &result.information, &gradient);
  }
  return result;
}

}  // namespace rigcal
