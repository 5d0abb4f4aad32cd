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
#include "server/solve/evaluate/calibration_error.h"

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

// How triangulated points move when the cameras are wrong, to first order.
struct PointGains {
  std::vector<size_t> points;  // indices into the grid: two cameras see them, from apart
  PointGainMatrix gain;
  std::vector<double> noise_m;  // by point: one sigma (3-D) from centres with `sigma_px` alone
};

// Of the points of the grid that are inside and that can be triangulated: from all cameras that see
// them, with equal weights. Where their rays are almost parallel, as between two cameras that face
// each other, they cannot. `parameters` are the columns.
PointGains ComputeGains(const BundleProblem& problem, const std::vector<CameraDescription>& cameras,
                        const std::vector<ReducedParameter>& parameters, const WavedGrid& grid,
                        double sigma_px);

// A subset of at most `count` of the points, evenly chosen.
PointGains ChoosePoints(const PointGains& gains, size_t count);

// Where the points are, frame rig, metres.
std::vector<Eigen::Vector3d> PlacesOf(const PointGains& gains, const WavedGrid& grid);

// Expected errors of the calibration at these points: where it would triangulate a point whose
// images are exact. Without the error of the rig as a whole (RemoveRigidMotion).
struct ExpectedError {
  std::vector<size_t> points;   // indices into the grid
  std::vector<double> sigma_m;  // by point: one sigma (3-D)
  double median_m = 0;          // of sigma_m
  double p95_m = 0, p95_bound_m = 0;  // as CalibrationError
  double worst_m = 0;         // of sigma_m
  size_t worst_point = 0;     // index into the grid
  double noise_median_m = 0;  // of PointGains::noise_m
};

// `covariance` of the parameters (calibration_error.h). No point: zeros.
ExpectedError ComputeExpectedError(PointGains gains, const Eigen::MatrixXd& covariance,
                                   const WavedGrid& grid);

}  // namespace rigcal::server
