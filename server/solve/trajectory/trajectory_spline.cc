// SPDX-License-Identifier: Apache-2.0
#include "server/solve/trajectory/trajectory_spline.h"

#include <algorithm>
#include <cmath>

#include "server/solve/trajectory/banded_matrix.h"

namespace rigcal::server {
namespace {

// Of a knot that no pose reaches, in units of the poses' information.
constexpr double kHold = 1e-9;

}  // namespace

SplineWeights WeightsAt(const TrajectorySpan& span, double time_s) {
  const double at = (time_s - span.begin_s) / span.step_s;
  SplineWeights weights;
  weights.first_knot =
      std::clamp<Eigen::Index>(static_cast<Eigen::Index>(std::floor(at)), 0, span.knot_count() - 4);
  const double f = at - static_cast<double>(weights.first_knot), g = 1 - f;
  weights.value = Eigen::Vector4d(g * g * g, 3 * f * f * f - 6 * f * f + 4,
                                  3 * g * g * g - 6 * g * g + 4, f * f * f) /
                  6;
  weights.slope =
      Eigen::Vector4d(-g * g, 3 * f * f - 4 * f, -3 * g * g + 4 * g, f * f) / (2 * span.step_s);
  return weights;
}

TrajectoryPose PoseAt(const TrajectorySpan& span, const SplineWeights& weights) {
  const auto knots = Eigen::Map<const Eigen::MatrixXd>(
      span.knots.data() + weights.first_knot * span.size, span.size, 4);
  TrajectoryPose pose;
  pose.origin_m = knots.topRows<3>() * weights.value;
  pose.origin_m_s = knots.topRows<3>() * weights.slope;
  if (!span.has_direction()) return pose;
  const Eigen::Vector3d along = knots.bottomRows<3>() * weights.value;
  const double length = along.norm();
  if (!(length > 0)) return pose;
  pose.direction = along / length;
  pose.direction_by_spline =
      (Eigen::Matrix3d::Identity() - pose.direction * pose.direction.transpose()) / length;
  pose.direction_s = pose.direction_by_spline * (knots.bottomRows<3>() * weights.slope);
  return pose;
}

void FitSpan(const std::vector<double>& times_s, const Eigen::MatrixXd& values, double sigma,
             double third_difference_sigma, double end_s, TrajectorySpan* span) {
  const auto segments = std::max<Eigen::Index>(
      1, static_cast<Eigen::Index>(std::ceil((end_s - span->begin_s) / span->step_s)));
  const Eigen::Index count = segments + 3;
  span->knots = Eigen::VectorXd::Zero(count * span->size);
  BandedMatrix matrix(count, 3);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(count, span->size);
  const double price = sigma * sigma / (third_difference_sigma * third_difference_sigma);
  for (Eigen::Index k = 0; k < count; ++k) matrix(k, k) = kHold;
  for (size_t i = 0; i < times_s.size(); ++i) {
    const SplineWeights weights = WeightsAt(*span, times_s[i]);
    for (Eigen::Index a = 0; a < 4; ++a) {
      right.row(weights.first_knot + a) +=
          weights.value[a] * values.col(static_cast<Eigen::Index>(i)).transpose();
      for (Eigen::Index b = 0; b <= a; ++b) {
        matrix(weights.first_knot + a, weights.first_knot + b) +=
            weights.value[a] * weights.value[b];
      }
    }
  }
  for (Eigen::Index k = 0; k + 4 <= count; ++k) {
    for (Eigen::Index a = 0; a < 4; ++a) {
      for (Eigen::Index b = 0; b <= a; ++b) {
        matrix(k + a, k + b) += price * kThirdDifference[a] * kThirdDifference[b];
      }
    }
  }
  if (!matrix.Factor()) return;
  matrix.SolveLower(right);
  for (Eigen::Index i = 0; i < span->size; ++i) matrix.SolveUpper(right.col(i));
  Eigen::Map<Eigen::MatrixXd>(span->knots.data(), span->size, count) = right.transpose();
}

}  // namespace rigcal::server
