// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/camera/camera_description.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/line_bundle.h"

namespace rigcal::server {

// Grid points over the volume that the target was waved through, and one step beyond it. Frame
// `rig`, metres; x runs fastest.
struct WavedGrid {
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();
  double step_m = 0;
  std::array<int, 3> counts = {0, 0, 0};
  std::vector<uint32_t> wand_counts;  // how often the target was nearest to the point
  std::vector<bool> inside;           // waved, or a neighbour of a waved point

  size_t size() const { return wand_counts.size(); }
  Eigen::Vector3d Point(size_t index) const;
  std::array<int, 3> Cell(size_t index) const;
  // Of the point nearest to a place; none outside the grid.
  std::optional<size_t> Nearest(const Eigen::Vector3d& point_m) const;
};

// From the placed instants; at most `max_points` points. None placed: no points.
WavedGrid MeasureWavedGrid(const BundleProblem& problem, size_t max_points);

// How a triangulated point moves when the cameras are wrong, to first order.
struct PointGain {
  int camera_count = 0;  // that see it; with fewer than two the rest is unset
  Eigen::Matrix<double, 3, Eigen::Dynamic> gain;  // by the parameters, metres per unit
  double noise_m = 0;  // one sigma (3-D) from centres with `sigma_px` alone
};

// Of every point of the grid that is inside; others have no cameras. `parameters` are the columns.
// Points are triangulated from all cameras that see them, with equal weights.
std::vector<PointGain> ComputeGains(const BundleProblem& problem,
                                    const std::vector<CameraDescription>& cameras,
                                    const std::vector<ReducedParameter>& parameters,
                                    const WavedGrid& grid, double sigma_px);

// Expected errors of the calibration at the points that two cameras see: where it would triangulate
// a point whose images are exact. Without the error of the rig as a whole: what the best rigid
// motion of these points takes away (six degrees of freedom; which frame a rig has is a matter of
// choice).
struct ExpectedError {
  std::vector<size_t> points;   // indices into the grid
  std::vector<double> sigma_m;  // by point: one sigma (3-D)
  double median_m = 0;          // of sigma_m
  // So large is the error in 95 % of the points, or smaller, with a probability of 95 %.
  double p95_m = 0;
  double worst_m = 0;         // of sigma_m
  size_t worst_point = 0;     // index into the grid
  double noise_median_m = 0;  // of PointGain::noise_m
};

// `covariance` of the parameters. Deterministic: the probability is that of 64 draws from it with
// fixed random numbers. No point: zeros.
ExpectedError ComputeExpectedError(const std::vector<PointGain>& gains,
                                   const Eigen::MatrixXd& covariance, const WavedGrid& grid);

// Only the 95th percentile of sigma over these points, for comparisons; gains are those of
// FreeOfDatum.
double ErrorPercentile(const std::vector<PointGain>& gains, const Eigen::MatrixXd& covariance);

// A subset of at most `count` seen points, evenly chosen, with the best rigid motion of the subset
// taken out of their gains.
std::vector<PointGain> FreeOfDatum(const std::vector<PointGain>& gains, const WavedGrid& grid,
                                   size_t count);

}  // namespace rigcal::server
