// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/statistics.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>
#include <numeric>

namespace rigcal::accuracy {

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double RootMeanSquare(const std::vector<double>& values) {
  const double sum = std::inner_product(values.begin(), values.end(), values.begin(), 0.0);
  return std::sqrt(sum / static_cast<double>(values.size()));
}

Interval ChiSquareShareInterval(double dof, double probability) {
  if (!(dof > 0)) return {};
  const boost::math::chi_squared distribution(dof);
  const double tail = 0.5 * (1 - probability);
  return {boost::math::quantile(distribution, tail) / dof,
          boost::math::quantile(boost::math::complement(distribution, tail)) / dof};
}

Nees NormalisedErrorSquared(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance) {
  constexpr double kNegligible = 1e-9;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  if (!covariance.allFinite() || !error.allFinite()) return {nan, static_cast<int>(error.size())};
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const Eigen::VectorXd inverse_sigma =
      sigma.unaryExpr([](double value) { return value > 0 ? 1 / value : 0.0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      inverse_sigma.asDiagonal() * covariance * inverse_sigma.asDiagonal());
  const Eigen::VectorXd along =
      eigen.eigenvectors().transpose() * inverse_sigma.cwiseProduct(error).eval();
  Nees nees;
  for (Eigen::Index i = 0; i < along.size(); ++i) {
    if (eigen.eigenvalues()[i] < kNegligible) continue;
    nees.value += along[i] * along[i] / eigen.eigenvalues()[i];
    ++nees.dof;
  }
  return nees;
}

void NeesSum::Add(const Nees& nees) {
  sum_ += nees.value;
  dof_ += nees.dof;
  ++trials_;
}

}  // namespace rigcal::accuracy
