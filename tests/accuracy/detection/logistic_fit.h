// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace rigcal::accuracy {

// One thing that is or is not of a class. `doubts` are features of which more makes it less likely.
struct LogisticSample {
  Eigen::VectorXd doubts;
  bool is_positive = false;
};

struct LogisticModel {
  double bias = 0;
  Eigen::VectorXd weights;  // log-odds = bias - weights . doubts

  double LogOdds(const Eigen::VectorXd& doubts) const { return bias - weights.dot(doubts); }
};

// Fits a logistic model whose weights are not negative: the most likely one under a Gaussian prior
// around `prior`, with one sigma of `weight_sigmas` and `bias_sigma` (Hastie, Tibshirani, Friedman,
// The Elements of Statistical Learning, 4.4: Newton's method, with weights that would become
// negative held at 0).
LogisticModel FitLogistic(const std::vector<LogisticSample>& samples, const LogisticModel& prior,
                          const Eigen::VectorXd& weight_sigmas, double bias_sigma);

}  // namespace rigcal::accuracy
