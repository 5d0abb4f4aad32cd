// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <limits>
#include <optional>
#include <vector>

#include "server/solve/bundle/envelope_cholesky.h"
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
  std::optional<EnvelopeCholesky> factor_;
  // Where there is no factor, and the size allows it.
  std::optional<Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>> eigen_;
};

}  // namespace rigcal::server
