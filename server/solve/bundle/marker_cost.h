// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/cost_function.h>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// The residual of one marker, r = L (p - (u - dt u')) of bundle_problem.h, with analytic
// derivatives. Two residuals; parameter blocks, in this order:
//   rotation (4)     of cam_from_rig, Eigen's storage x y z w
//   translation (3)  of cam_from_rig, metres
//   intrinsics (n)   fx fy cx cy and the coefficients of `model`
//   offset (1)       of the clock, seconds
//   rate (1)         of the clock, s/s
//   position (1)     of the marker along the target, metres
//   target (6)       origin in the rig (3, metres), direction (3, unit)
// Evaluation fails, and with it the step that led there, for a marker the camera cannot see; a
// silent zero would draw the target behind the camera.
class MarkerCost final : public ceres::CostFunction {
 public:
  MarkerCost(DistortionModel model, const BundleMarker& marker, double clock_time_s);

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  DistortionModel model_;
  Eigen::Vector2d centre_px_;
  Eigen::Vector2d velocity_px_s_;
  Eigen::Matrix2d sqrt_information_;
  double clock_time_s_;
};

// (value - mean) / sigma of one scalar block.
class ScalarPriorCost final : public ceres::CostFunction {
 public:
  ScalarPriorCost(double mean, double sigma);
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  double mean_, sigma_;
};

// ((b - a) - span) / sigma for two scalar blocks a, b: the build tolerance of a target's span.
class SpanPriorCost final : public ceres::CostFunction {
 public:
  SpanPriorCost(double span_m, double sigma_m);
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  double span_m_, sigma_m_;
};

// (value_i - mean_i) / sigma_i for those i with sigma_i > 0, 0 for the others.
class VectorPriorCost final : public ceres::CostFunction {
 public:
  VectorPriorCost(const IntrinsicsVector& mean, const IntrinsicsVector& sigma);
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  IntrinsicsVector mean_, inverse_sigma_;
};

// (|c_b - c_a| - distance) / sigma, with c the centres of two cameras. Parameter blocks: rotation
// (4) and translation (3) of cam_from_rig of a, then of b, as in MarkerCost. Fails where the
// centres are one place, from which there is no direction to step to.
class DistancePriorCost final : public ceres::CostFunction {
 public:
  DistancePriorCost(double distance_m, double sigma_m);
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  double distance_m_, sigma_m_;
};

}  // namespace rigcal::server
