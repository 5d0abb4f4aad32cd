// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace rigcal::accuracy {

struct Interval {
  double low = 0;
  double high = 0;
  bool Contains(double value) const { return value >= low && value <= high; }
};

double Mean(const std::vector<double>& values);
double RootMeanSquare(const std::vector<double>& values);

// The central interval of chi-square / dof with this probability.
Interval ChiSquareShareInterval(double dof, double probability);

// A normalised error squared, e^T C^-1 e, and its degrees of freedom.
struct Nees {
  double value = 0;
  int dof = 0;
};

// Uses the inverse on the range of `covariance`, whose dimension is `dof`. The
// parameters may be of different units: negligible eigenvalues are found after scaling to unit
// diagonal. A covariance that is not finite gives NaN.
Nees NormalisedErrorSquared(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance);

// Sums over independent trials.
class NeesSum {
 public:
  void Add(const Nees& nees);
  int trials() const { return trials_; }
  int dof() const { return dof_; }
  // Mean of e^T C^-1 e over its degrees of freedom: 1 if the covariance is consistent.
  double Ratio() const { return sum_ / dof_; }
  // Contains Ratio() of a consistent covariance with this probability.
  Interval ConsistentInterval(double probability) const {
    return ChiSquareShareInterval(dof_, probability);
  }

 private:
  double sum_ = 0;
  int dof_ = 0;
  int trials_ = 0;
};

}  // namespace rigcal::accuracy
