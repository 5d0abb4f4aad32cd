// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace rigcal::server {

// A symmetric matrix whose entries further than `bandwidth` from the diagonal are zero. Kept is the
// lower triangle: entry (i + k, i) in row k, column i.
class BandedMatrix {
 public:
  BandedMatrix() = default;
  BandedMatrix(Eigen::Index size, Eigen::Index bandwidth)
      : values_(Eigen::MatrixXd::Zero(bandwidth + 1, size)) {}

  Eigen::Index size() const { return values_.cols(); }
  Eigen::Index bandwidth() const { return values_.rows() - 1; }
  // i >= j, within the band.
  double& operator()(Eigen::Index i, Eigen::Index j) { return values_(i - j, j); }
  double operator()(Eigen::Index i, Eigen::Index j) const { return values_(i - j, j); }

  // Becomes its Cholesky factor L. False: it is not positive definite.
  bool Factor();
  // Of a factor L: x becomes L^-1 x, column by column, and L^-T x.
  void SolveLower(Eigen::Ref<Eigen::MatrixXd> x) const;
  void SolveUpper(Eigen::Ref<Eigen::VectorXd> x) const;
  // Of a factor L: the entries of (L L^T)^-1 within the band (Takahashi, Fagan and Chen 1973).
  BandedMatrix Inverse() const;

 private:
  Eigen::MatrixXd values_;
};

}  // namespace rigcal::server
