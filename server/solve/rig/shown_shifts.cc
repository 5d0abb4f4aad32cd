// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/shown_shifts.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

constexpr size_t kEnoughInstants = 400;
constexpr double kPoseStep = 1e-4;  // of a distance of one, and of a direction
constexpr double kPoseRidge = 1e-9, kShareRidge = 1e-3;
constexpr int kVarianceRounds = 300;

using PoseVector = Eigen::Matrix<double, 5, 1>;

// One row of a camera.
struct ShiftedRow {
  double square = 0;                      // |v|^2
  PoseVector along = PoseVector::Zero();  // J^T v
};

BundleInstant Moved(const BundleInstant& instant, int parameter, double step) {
  BundleInstant moved = instant;
  if (parameter < 3) {
    moved.origin_m[parameter] += step;
    return moved;
  }
  const Eigen::Vector3d across = instant.direction.unitOrthogonal();
  const Eigen::Vector3d other = instant.direction.cross(across);
  moved.direction = (instant.direction + step * (parameter == 3 ? across : other)).normalized();
  return moved;
}

// By camera; and the normal equations of the instant's pose.
std::map<size_t, ShiftedRow> RowsAt(const BundleProblem& problem, const BundleInstant& instant,
                                    double step_m, Eigen::Matrix<double, 5, 5>* normal) {
  const int parameters = problem.target.marker_positions_m.size() > 1 ? 5 : 3;
  std::map<size_t, ShiftedRow> rows;
  ForEachUsedMarker(problem, instant,
                    [&](const BundleObservation& observation, const BundleMarker& marker) {
                      const auto here = MarkerResidualPx(problem, instant, observation, marker);
                      if (!here) return;
                      Eigen::Matrix<double, 2, 5> jacobian = Eigen::Matrix<double, 2, 5>::Zero();
                      for (int p = 0; p < parameters; ++p) {
                        const double step = p < 3 ? step_m : kPoseStep;
                        const auto there =
                            MarkerResidualPx(problem, Moved(instant, p, step), observation, marker);
                        if (!there) return;
                        jacobian.col(p) = marker.sqrt_information * (*there - *here) / step;
                      }
                      const Eigen::Vector2d motion = marker.sqrt_information * marker.velocity_px_s;
                      ShiftedRow& row = rows[static_cast<size_t>(observation.camera)];
                      row.square += motion.squaredNorm();
                      row.along += jacobian.transpose() * motion;
                      *normal += jacobian.transpose() * jacobian;
                    });
  return rows;
}

}  // namespace

Eigen::MatrixXd ShownShares(const BundleProblem& problem) {
  const auto count = static_cast<Eigen::Index>(problem.cameras.size());
  Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(count, count);
  Eigen::VectorXd rows_of = Eigen::VectorXd::Zero(count);
  const size_t stride = 1 + problem.instants.size() / kEnoughInstants;
  for (size_t i = 0; i < problem.instants.size(); i += stride) {
    const BundleInstant& instant = problem.instants[i];
    if (!instant.used || instant.is_rigid) continue;
    const double step_m = kPoseStep * std::max(1e-3, instant.origin_m.norm());
    Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
    const std::map<size_t, ShiftedRow> rows = RowsAt(problem, instant, step_m, &normal);
    if (rows.size() < 2) continue;
    // Of a point the direction has none.
    normal.diagonal().array() += kPoseRidge * normal.diagonal().array().maxCoeff();
    const Eigen::LDLT<Eigen::Matrix<double, 5, 5>> factor(normal);
    for (const auto& [a, row] : rows) {
      if (!(row.square > 0)) continue;
      const auto seen = static_cast<Eigen::Index>(a);
      ++rows_of[seen];
      const PoseVector weights = factor.solve(row.along);
      for (const auto& [b, other] : rows) {
        const double shown = (a == b ? 1 : 0) - weights.dot(other.along) / row.square;
        shares(seen, static_cast<Eigen::Index>(b)) += shown * shown;
      }
    }
  }
  for (Eigen::Index c = 0; c < count; ++c) {
    if (rows_of[c] > 0) shares.row(c) /= rows_of[c];
  }
  return shares;
}

std::vector<double> OwnVariances(const Eigen::MatrixXd& shares, const std::vector<double>& shown) {
  const auto count = static_cast<Eigen::Index>(shown.size());
  Eigen::VectorXd own = Eigen::VectorXd::Zero(count);
  Eigen::MatrixXd normal = shares.transpose() * shares;
  const double trace = normal.trace();
  if (count == 0 || !(trace > 0)) return shown;
  normal.diagonal().array() += kShareRidge * trace / static_cast<double>(count);
  const Eigen::VectorXd right =
      shares.transpose() * Eigen::Map<const Eigen::VectorXd>(shown.data(), count);
  own = normal.ldlt().solve(right).cwiseMax(0.0);
  for (int round = 0; round < kVarianceRounds; ++round) {
    for (Eigen::Index c = 0; c < count; ++c) {
      const double rest = right[c] - normal.row(c).dot(own) + normal(c, c) * own[c];
      own[c] = std::max(0.0, rest / normal(c, c));
    }
  }
  return {own.begin(), own.end()};
}

}  // namespace rigcal::server
