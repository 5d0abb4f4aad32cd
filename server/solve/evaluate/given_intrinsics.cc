// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/given_intrinsics.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/complement.hpp>

namespace rigcal::server {
namespace {

// Share of a direction's variance that the prior alone would leave; above it the data say nothing.
constexpr double kPriorAlone = 0.99;

struct RefinedParameter {
  Eigen::Index row;  // of the covariance
  size_t camera;
  double difference;  // from the given value, in sigmas of the prior
  double prior_sigma;
};

// Does the difference of these parameters exceed what chance does in all but `significance` of the
// cases? In units of the priors, with S the covariance of the estimate (data and priors), the
// difference has covariance S - S^2 if the given values are true. Errors in common make it larger
// by the design effect; the scatter of the blocks itself is too few numbers for so many dimensions.
bool IsSignificant(const std::vector<RefinedParameter>& all, const std::vector<size_t>& chosen,
                   const RigUncertainty& uncertainty, double significance) {
  const Eigen::MatrixXd& covariance = uncertainty.noise_covariance;
  const auto size = static_cast<Eigen::Index>(chosen.size());
  if (size == 0) return false;
  Eigen::MatrixXd relative(size, size);
  Eigen::VectorXd difference(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const RefinedParameter& a = all[chosen[static_cast<size_t>(i)]];
    difference[i] = a.difference;
    for (Eigen::Index j = 0; j < size; ++j) {
      const RefinedParameter& b = all[chosen[static_cast<size_t>(j)]];
      relative(i, j) = covariance(a.row, b.row) / (a.prior_sigma * b.prior_sigma);
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(relative);
  if (eigen.info() != Eigen::Success) return false;
  const Eigen::VectorXd along = eigen.eigenvectors().transpose() * difference;
  double statistic = 0;
  int degrees = 0;
  for (Eigen::Index i = 0; i < size; ++i) {
    const double share = eigen.eigenvalues()[i];
    if (!(share > 0) || share > kPriorAlone) continue;
    statistic += along[i] * along[i] / (share - share * share);
    ++degrees;
  }
  if (degrees == 0) return false;
  statistic /= std::max(1.0, uncertainty.design_effect);
  const boost::math::chi_squared distribution(degrees);
  return statistic > boost::math::quantile(boost::math::complement(distribution, significance));
}

}  // namespace

GivenIntrinsicsTest TestGivenIntrinsics(const BundleProblem& refined,
                                        const RigUncertainty& uncertainty, double significance) {
  GivenIntrinsicsTest test;
  test.disagrees.assign(refined.cameras.size(), false);
  std::vector<RefinedParameter> parameters;
  for (size_t i = 0; i < uncertainty.parameters.size(); ++i) {
    const ReducedParameter& parameter = uncertainty.parameters[i];
    if (parameter.kind != ReducedParameterKind::kIntrinsic) continue;
    const auto c = static_cast<size_t>(parameter.index);
    const BundleCamera& camera = refined.cameras[c];
    const double sigma = camera.intrinsics_sigma[parameter.component];
    const double given = camera.intrinsics_mean[parameter.component];
    parameters.push_back({static_cast<Eigen::Index>(i), c,
                          (camera.intrinsics[parameter.component] - given) / sigma, sigma});
  }
  const double each = significance / static_cast<double>(refined.cameras.size() + 1);
  std::vector<size_t> all;
  for (size_t i = 0; i < parameters.size(); ++i) all.push_back(i);
  test.agrees = !IsSignificant(parameters, all, uncertainty, each);
  for (size_t c = 0; c < refined.cameras.size(); ++c) {
    std::vector<size_t> own;
    for (size_t i = 0; i < parameters.size(); ++i) {
      if (parameters[i].camera == c) own.push_back(i);
    }
    test.disagrees[c] = IsSignificant(parameters, own, uncertainty, each);
    test.agrees = test.agrees && !test.disagrees[c];
  }
  return test;
}

std::vector<Eigen::Vector4d> PriorShares(const BundleProblem& refined,
                                         const RigUncertainty& uncertainty) {
  std::vector<Eigen::Vector4d> shares(refined.cameras.size(), Eigen::Vector4d::Zero());
  const Eigen::MatrixXd& covariance = uncertainty.noise_covariance;
  Eigen::VectorXd prior = Eigen::VectorXd::Zero(covariance.rows());
  for (size_t i = 0; i < uncertainty.parameters.size(); ++i) {
    const ReducedParameter& parameter = uncertainty.parameters[i];
    if (parameter.kind != ReducedParameterKind::kIntrinsic) continue;
    const double sigma =
        refined.cameras[static_cast<size_t>(parameter.index)].intrinsics_sigma[parameter.component];
    if (sigma > 0) prior[static_cast<Eigen::Index>(i)] = 1 / (sigma * sigma);
  }
  for (size_t c = 0; c < shares.size(); ++c) {
    for (int k = 0; k < 4; ++k) {
      const Eigen::Index row =
          uncertainty.Row({ReducedParameterKind::kIntrinsic, static_cast<int>(c), k});
      if (row < 0 || !(covariance(row, row) > 0)) continue;
      shares[c][k] =
          covariance.col(row).cwiseAbs2().cwiseProduct(prior).sum() / covariance(row, row);
    }
  }
  return shares;
}

}  // namespace rigcal::server
