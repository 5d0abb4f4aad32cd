// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <limits>
#include <vector>

#include "server/solve/bundle/line_bundle.h"

namespace rigcal::server {

inline constexpr double kUndetermined = std::numeric_limits<double>::infinity();

// What is known of the parameters of a bundle, by their information.
class ParameterKnowledge {
 public:
  explicit ParameterKnowledge(const ReducedInformation& information);

  // -1: it is none of the parameters.
  Eigen::Index Row(const ReducedParameter& parameter) const;
  Eigen::Index size() const { return scaled_.rows(); }

  // Of the linear function of the parameters with this gradient; kUndetermined where the data leave
  // it open.
  double Variance(const Eigen::VectorXd& gain) const;

 private:
  std::vector<ReducedParameter> parameters_;
  Eigen::VectorXd scale_;
  Eigen::MatrixXd scaled_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen_;  // where there is no factor
  bool is_regular_ = true;
};

}  // namespace rigcal::server
