// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/marker_residual.h"

namespace rigcal::server {

// As the residual reads it. L is replaced by the upper triangle with the same L^T L: a rotation of
// the residual, which changes no cost.
MeasuredMarker<double> ToMeasured(const BundleMarker& marker);

// u - dt u': where the marker would have been measured at the instant's time.
Eigen::Vector2d CentreAtInstantPx(const BundleProblem& problem,
                                  const BundleObservation& observation, const BundleMarker& marker);

// Residual p - (u - dt u') of one marker in pixels, used or not. None where the camera cannot see
// the marker.
std::optional<Eigen::Vector2d> MarkerResidualPx(const BundleProblem& problem,
                                                const BundleInstant& instant,
                                                const BundleObservation& observation,
                                                const BundleMarker& marker);

}  // namespace rigcal::server
