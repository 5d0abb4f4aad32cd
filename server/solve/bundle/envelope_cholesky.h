// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "server/solve/bundle/envelope_matrix.h"

namespace rigcal::server {

// Cholesky factor of a symmetric positive definite matrix. In a large rig a camera shares instants
// with few others, and most of the reduced matrix is zero; with the cameras in a good order
// (camera_order.h) what is not zero lies near the diagonal. The factor is zero outside of the
// matrix's envelope, too, and only what lies within is computed, by blocks of rows (George and Liu
// 1981, Computer Solution of Large Sparse Positive Definite Systems, chapter 4). A matrix that is
// kept whole is factorised by Eigen's LLT.
class EnvelopeCholesky {
 public:
  explicit EnvelopeCholesky(EnvelopeMatrix matrix);
  // n x n, lower triangle.
  explicit EnvelopeCholesky(const Eigen::Ref<const Eigen::MatrixXd>& lower)
      : EnvelopeCholesky(EnvelopeMatrix(lower)) {}

  // The matrix is positive definite. Everything else needs that.
  bool ok() const { return ok_; }
  bool IsWhole() const { return factor_.IsWhole(); }
  Eigen::Index size() const { return factor_.size(); }

  // The right sides, n x m, by the factor L alone: their products with each other are then those
  // with the inverse in between.
  void SolveLowerInPlace(Eigen::MatrixXd* right) const;
  // Of one or several right sides, n x m.
  void SolveInPlace(Eigen::MatrixXd* right) const;
  Eigen::VectorXd Solve(const Eigen::VectorXd& right) const;
  Eigen::MatrixXd Inverse() const;
  // The inverse within the matrix's envelope (all of it, where the matrix is whole), without what
  // lies outside: Takahashi, Fagan and Chin 1973, "Formation of a sparse bus impedance matrix and
  // its application to short circuit study". Costs about as much as the factor.
  EnvelopeMatrix InverseWithin() const;

 private:
  bool Factorise();

  EnvelopeMatrix factor_;
  bool ok_ = false;
};

}  // namespace rigcal::server
