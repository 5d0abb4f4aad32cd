// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace rigcal::server {

// Lower triangle of a symmetric n x n matrix, of which each block of rows is kept from its first
// column that may differ from zero to the diagonal. Where that would save little, or the matrix is
// small, it is kept whole, as one block. Which of both follows from the size and the first columns
// alone.
class EnvelopeMatrix {
 public:
  EnvelopeMatrix() = default;
  // By row, the first column that may differ from zero (at most the row itself). All zero at first.
  explicit EnvelopeMatrix(const std::vector<Eigen::Index>& first);
  // Of a matrix whose lower triangle is given.
  explicit EnvelopeMatrix(const Eigen::Ref<const Eigen::MatrixXd>& lower);

  Eigen::Index size() const { return size_; }
  bool IsWhole() const { return rows_.size() <= 1; }

  size_t block_count() const { return rows_.size(); }
  // First row, number of rows, and first column that is kept, of a block; the latter is a row at
  // which a block begins.
  Eigen::Index RowOf(size_t block) const { return static_cast<Eigen::Index>(block) * height_; }
  Eigen::Index CountOf(size_t block) const { return rows_[block].rows(); }
  Eigen::Index FirstOf(size_t block) const { return first_[block]; }
  size_t BlockOf(Eigen::Index row) const { return static_cast<size_t>(row / height_); }
  // Rows of a block, columns FirstOf() to its last row. What lies above the diagonal means nothing.
  Eigen::MatrixXd& rows(size_t block) { return rows_[block]; }
  const Eigen::MatrixXd& rows(size_t block) const { return rows_[block]; }

  // row >= column; the column is kept.
  double& operator()(Eigen::Index row, Eigen::Index column) {
    const size_t block = BlockOf(row);
    return rows_[block](row - RowOf(block), column - first_[block]);
  }
  double operator()(Eigen::Index row, Eigen::Index column) const {
    const size_t block = BlockOf(row);
    return rows_[block](row - RowOf(block), column - first_[block]);
  }
  Eigen::VectorXd Diagonal() const;
  void SetZero();
  // Both triangles.
  Eigen::MatrixXd Symmetric() const;

 private:
  void Allocate(const std::vector<Eigen::Index>& first);

  Eigen::Index size_ = 0;
  Eigen::Index height_ = 1;
  std::vector<Eigen::Index> first_;
  std::vector<Eigen::MatrixXd> rows_;
};

}  // namespace rigcal::server
