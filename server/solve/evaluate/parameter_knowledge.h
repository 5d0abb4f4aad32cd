// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <limits>
#include <optional>
#include <utility>
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

  // Linear functions that all have something in common, such as the motion of the whole rig: the
  // gradient is that of a few neighbouring parameters and a sum of columns of `common`.
  struct Gain {
    std::vector<std::pair<Eigen::Index, double>> own;  // row and derivative
    Eigen::VectorXd of_common;                         // by column
  };
  // The variance of each, without a product for each where the information is sparse.
  std::vector<double> Variances(const std::vector<Gain>& gains,
                                const Eigen::MatrixXd& common) const;

 private:
  std::vector<ReducedParameter> parameters_;
  Eigen::VectorXd scale_;
  Eigen::MatrixXd scaled_;
  std::optional<EnvelopeCholesky> factor_;
  // Where there is no factor, and the size allows it.
  std::optional<Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>> eigen_;
};

}  // namespace rigcal::server
