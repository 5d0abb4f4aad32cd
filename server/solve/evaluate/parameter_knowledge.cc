// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/parameter_knowledge.h"

#include <algorithm>

namespace rigcal::server {
namespace {

// Of a system with a unit diagonal: what is smaller is no information.
constexpr double kNullEigenvalue = 1e-11;
// Squared part of a parameter in what is not determined.
constexpr double kNullShare = 1e-6;
constexpr Eigen::Index kMaxEigenSize = 400;

}  // namespace

ParameterKnowledge::ParameterKnowledge(const ReducedInformation& information)
    : parameters_(information.parameters) {
  scale_ = information.information.diagonal().cwiseMax(0).cwiseSqrt();
  for (Eigen::Index i = 0; i < scale_.size(); ++i) scale_[i] = scale_[i] > 0 ? 1 / scale_[i] : 0;
  scaled_ = scale_.asDiagonal() * information.information * scale_.asDiagonal();
  factor_.emplace(scaled_);
  if (factor_->ok() && scale_.minCoeff() > 0) return;
  factor_.reset();
  if (scaled_.rows() <= kMaxEigenSize) eigen_.emplace(scaled_);
}

Eigen::Index ParameterKnowledge::Row(const ReducedParameter& parameter) const {
  const auto found = std::ranges::find(parameters_, parameter);
  return found == parameters_.end() ? -1 : found - parameters_.begin();
}

double ParameterKnowledge::Variance(const Eigen::VectorXd& gain) const {
  const Eigen::VectorXd a = scale_.cwiseProduct(gain);
  if (factor_) return std::max(0.0, a.dot(factor_->Solve(a)));
  if (!eigen_) return kUndetermined;
  const Eigen::VectorXd parts = eigen_->eigenvectors().transpose() * a;
  double variance = 0, lost = 0;
  for (Eigen::Index i = 0; i < parts.size(); ++i) {
    const double part = parts[i] * parts[i], value = eigen_->eigenvalues()[i];
    if (value > kNullEigenvalue) {
      variance += part / value;
    } else {
      lost += part;
    }
  }
  // What has no scale has no information at all.
  const bool touches_nothing = (scale_.array() == 0 && gain.array() != 0).any();
  return touches_nothing || lost > kNullShare * a.squaredNorm() ? kUndetermined : variance;
}

std::vector<double> ParameterKnowledge::Variances(const std::vector<Gain>& gains,
                                                  const Eigen::MatrixXd& common) const {
  std::vector<double> variances;
  if (!factor_ || factor_->IsWhole()) {
    for (const Gain& gain : gains) {
      Eigen::VectorXd whole = common * gain.of_common;
      for (const auto& [row, derivative] : gain.own) whole[row] += derivative;
      variances.push_back(Variance(whole));
    }
    return variances;
  }
  const EnvelopeMatrix inverse = factor_->InverseWithin();
  const Eigen::MatrixXd scaled = scale_.asDiagonal() * common;
  Eigen::MatrixXd of_common = scaled;  // covariance times the common columns
  factor_->SolveInPlace(&of_common);
  const Eigen::MatrixXd between = scaled.transpose() * of_common;
  for (const Gain& gain : gains) {
    double variance = gain.of_common.dot(between * gain.of_common);
    for (const auto& [i, d_i] : gain.own) {
      const double a_i = scale_[i] * d_i;
      variance += 2 * a_i * of_common.row(i).dot(gain.of_common);
      for (const auto& [j, d_j] : gain.own) {
        variance += a_i * scale_[j] * d_j * inverse(std::max(i, j), std::min(i, j));
      }
    }
    variances.push_back(std::max(0.0, variance));
  }
  return variances;
}

}  // namespace rigcal::server
