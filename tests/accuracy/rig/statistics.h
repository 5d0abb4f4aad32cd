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
// Linear between neighbouring values; `share` 0 to 1. NaN for no values.
double Quantile(std::vector<double> values, double share);

// Where chi-square / dof lies with this probability, as much left out on either side.
Interval ChiSquareShareInterval(double dof, double probability);

// A normalised error squared, e^T C^-1 e, and its degrees of freedom.
struct Nees {
  double value = 0;
  int dof = 0;
};

// With the inverse on the part of the space that `covariance` fills, which is `dof` wide. The
// parameters may be of different units: what is negligible is judged after scaling to unit
// diagonal. A covariance that is not finite gives NaN.
Nees NormalisedErrorSquared(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance);

// Sums over independent trials.
class NeesSum {
 public:
  void Add(const Nees& nees);
  int trials() const { return trials_; }
  int dof() const { return dof_; }
  // Mean of e^T C^-1 e over its degrees of freedom: 1 where the covariance is honest.
  double Ratio() const { return sum_ / dof_; }
  Interval Honest(double probability) const { return ChiSquareShareInterval(dof_, probability); }

 private:
  double sum_ = 0;
  int dof_ = 0;
  int trials_ = 0;
};

}  // namespace rigcal::accuracy
