// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace rigcal::server {

// Cholesky factor of a symmetric positive definite matrix. In a large rig a camera shares instants
// with few others, and most of the reduced matrix is zero: rows and columns are then reordered so
// that what is not zero lies near the diagonal, and of each row only what lies between its first
// element that is not zero and the diagonal is kept and computed, by blocks of rows: the factor
// is zero elsewhere (George and Liu 1981, Computer Solution of Large Sparse Positive Definite
// Systems, chapter 4: reverse Cuthill-McKee order, envelope method). A matrix that is small, or of
// which little is zero, is factorised as it is, by Eigen's LLT. Which of both follows from the
// matrix alone.
class EnvelopeCholesky {
 public:
  // n x n, lower triangle.
  explicit EnvelopeCholesky(const Eigen::Ref<const Eigen::MatrixXd>& lower);

  // The matrix is positive definite. Everything else needs that.
  bool ok() const { return ok_; }
  bool is_reordered() const { return !order_.empty(); }
  Eigen::Index size() const { return size_; }

  // Of one or several right sides, n x m.
  void SolveInPlace(Eigen::MatrixXd* right) const;
  Eigen::VectorXd Solve(const Eigen::VectorXd& right) const;
  Eigen::MatrixXd Inverse() const;

 private:
  bool Order(const Eigen::Ref<const Eigen::MatrixXd>& lower);
  void Fill(const Eigen::Ref<const Eigen::MatrixXd>& lower);
  void Factorise();
  Eigen::Index Count(size_t block) const;

  Eigen::Index size_ = 0;
  bool ok_ = false;
  Eigen::MatrixXd whole_;              // the factor, where the matrix is not reordered
  std::vector<Eigen::Index> order_;    // row of the matrix at each place; empty: not reordered
  std::vector<Eigen::Index> first_;    // by block of rows: place of its first column
  std::vector<Eigen::MatrixXd> rows_;  // by block of rows: columns first_ to its diagonal
};

}  // namespace rigcal::server
