// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "server/solve/rig/problem_builder.h"

namespace rigcal::server {

// What a robust loss makes of the covariance of the parameters: the factors of an M-estimator
// (Huber, Robust Statistics, section 7.6), here for residuals of two dimensions: with psi =
// rho'(s) e, s = |e|^2, the variance is
//   K^2 * E[rho'] * E[rho'^2 s] / 2 / E[psi']^2,   K = 1 + h Var[psi'] / E[psi']^2,
// with means over the markers for the expectations; psi' stands for the two eigenvalues of the
// derivative, h for the share of free parameters in the numbers that determine them. Residuals are
// smaller than errors: they are divided by sqrt(1 - h) first, with h of their own instant (Cook and
// Weisberg, Residuals and Influence in Regression, section 2.1), and those of interpolated centres
// by their noise_share (ImageMotion). For normal errors and the Cauchy loss at 2 sigmas the
// covariance comes to 1.092 times the Cramer-Rao bound.
struct LossFactors {
  double variance = 1;  // of the parameters, by the inverse of the information that rho' weighs
  double slope = 1;     // the mean derivative of psi by the mean weight
};

// Takes the residuals one after the other, for the Cauchy loss of the solve.
class LossSum {
 public:
  explicit LossSum(double loss_scale) : c2_(loss_scale * loss_scale) {}

  // Of a whitened residual: its squared norm, the share of its own variance that it has, and its
  // leverage (h above).
  void Add(double square, double noise_share, double leverage);
  double count() const { return count_; }
  // `free`: numbers that have been estimated, of twice as many as there are residuals. Both factors
  // are 1 where nothing is left over.
  LossFactors Factors(double free) const;

 private:
  double c2_;
  double weight_ = 0, slope_ = 0, slope_square_ = 0, square_ = 0, taken_ = 0, count_ = 0;
};

// Two cameras that see one marker each leave no redundancy; more leverage than this is not
// believed.
inline constexpr double kMaxLeverage = 0.8;

// Of the markers that are used; `free` parameters beside the poses of the instants.
LossFactors MeasureLossFactors(const BuiltProblem& built, double loss_scale, Eigen::Index free);

}  // namespace rigcal::server
