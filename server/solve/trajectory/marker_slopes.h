// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "server/solve/bundle/line_bundle_layout.h"
#include "server/solve/trajectory/trajectory_problem.h"
#include "server/solve/trajectory/trajectory_spline.h"

namespace rigcal::server {

// The whitened residual of a marker of a row (TrajectoryProblem::WhitenedResidual), and its
// derivatives. Those of a rotation are by a rotation vector in the camera's frame, from the left.
struct MarkerSlopes {
  SplineWeights weights;
  Eigen::Vector2d residual;
  // By the four knots from weights.first_knot on, number by number.
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 4 * TrajectorySpan::kLineSize> knots;
  // By the free parameters besides the knots that it depends on: column of the layout, derivative.
  std::vector<std::pair<int, Eigen::Vector2d>> reduced;
};

// At the problem's present values. The row must have a span, and the layout a view of its camera by
// its clock. False: the camera cannot see the marker; the slopes mean nothing then.
bool DifferentiateMarker(const TrajectoryProblem& problem, const LineBundleLayout& layout,
                         size_t row, const BundleObservation& observation,
                         const BundleMarker& marker, MarkerSlopes* slopes);

// For numeric derivatives: moves each unknown but the knots that a marker depends on by a small
// step, calls function(column, step), and moves it back.
void ForEachUnknownOf(const LineBundleLayout& layout, const BundleObservation& observation,
                      const BundleMarker& marker, BundleProblem* rows,
                      absl::FunctionRef<void(int column, double step)> function);

// By which a number of a knot is moved for the same; metres, or of the direction.
inline constexpr double kKnotStep = 1e-6;

}  // namespace rigcal::server
