// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace rigcal::server {

// The path of a target through a run of time without long gaps: a uniform cubic B-spline (de Boor,
// A Practical Guide to Splines, 1978) of
//   the origin, metres                      components 0 to 2
//   of a line target, its direction         components 3 to 5, of any length: what counts is
//                                           d / |d|, so that there is no chart to leave
// in the rig frame. Times are seconds from an origin that all spans share.
struct TrajectorySpan {
  static constexpr Eigen::Index kPointSize = 3, kLineSize = 6;

  double begin_s = 0;
  double step_s = 0.02;           // from one knot to the next
  Eigen::Index size = kLineSize;  // of a knot
  Eigen::VectorXd knots;          // one after the other, four at least

  Eigen::Index knot_count() const { return knots.size() / size; }
  double end_s() const { return begin_s + step_s * static_cast<double>(knot_count() - 3); }
  bool has_direction() const { return size == kLineSize; }
};

// The four knots that the path at one time depends on, and how. A little outside of the span its
// end polynomials go on.
struct SplineWeights {
  Eigen::Index first_knot = 0;
  Eigen::Vector4d value = Eigen::Vector4d::Zero();
  Eigen::Vector4d slope = Eigen::Vector4d::Zero();  // 1/s
};
SplineWeights WeightsAt(const TrajectorySpan& span, double time_s);

// The target at one time: a point of it at s along its direction is at origin + s * direction.
struct TrajectoryPose {
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero(), origin_m_s = Eigen::Vector3d::Zero();
  // Unit; zero of a point. The derivatives are by time and by the direction's spline.
  Eigen::Vector3d direction = Eigen::Vector3d::Zero(), direction_s = Eigen::Vector3d::Zero();
  Eigen::Matrix3d direction_by_spline = Eigen::Matrix3d::Zero();
};
TrajectoryPose PoseAt(const TrajectorySpan& span, const SplineWeights& weights);

// The smoothest span through poses at ascending times, one per column, each known to `sigma`: the
// sum of squared third differences of its knots over `third_difference_sigma`^2 is the price.
// `step_s` and `size` of the span are used; its knots begin at `begin_s` and reach `end_s`.
void FitSpan(const std::vector<double>& times_s, const Eigen::MatrixXd& values, double sigma,
             double third_difference_sigma, double end_s, TrajectorySpan* span);

// Weights of the third difference of neighbouring knots.
inline constexpr double kThirdDifference[4] = {-1, 3, -3, 1};

}  // namespace rigcal::server
