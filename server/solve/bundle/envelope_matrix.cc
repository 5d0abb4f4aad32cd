// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/envelope_matrix.h"

#include <algorithm>

namespace rigcal::server {
namespace {

using Eigen::Index;

// Rows of a block: as many as matrix products need to be fast.
constexpr Index kBlock = 64;
// Up to here an envelope saves nothing.
constexpr Index kSmall = 4 * kBlock;
// Of the products that factorise the whole matrix: with more the whole one is as fast.
constexpr double kWorth = 0.5;

}  // namespace

EnvelopeMatrix::EnvelopeMatrix(const std::vector<Index>& first) { Allocate(first); }

EnvelopeMatrix::EnvelopeMatrix(const Eigen::Ref<const Eigen::MatrixXd>& lower) {
  std::vector<Index> first(static_cast<size_t>(lower.rows()));
  for (Index row = 0; row < lower.rows(); ++row) first[static_cast<size_t>(row)] = row;
  if (lower.rows() > kSmall) {
    for (Index column = 0; column < lower.cols(); ++column) {
      const double* const values = lower.col(column).data();
      for (Index row = column + 1; row < lower.rows(); ++row) {
        Index& own = first[static_cast<size_t>(row)];
        if (values[row] != 0 && column < own) own = column;
      }
    }
  }
  Allocate(first);
  for (size_t b = 0; b < rows_.size(); ++b) {
    rows_[b] = lower.block(RowOf(b), first_[b], rows_[b].rows(), rows_[b].cols());
  }
}

void EnvelopeMatrix::Allocate(const std::vector<Index>& first) {
  size_ = static_cast<Index>(first.size());
  std::vector<Index> of_block;
  double products = 0, of_whole = 0;
  for (Index begin = 0; begin < size_; begin += kBlock) {
    const Index end = std::min(begin + kBlock, size_);
    const Index least = *std::min_element(first.begin() + begin, first.begin() + end);
    of_block.push_back(std::min(least, begin) / kBlock * kBlock);
    const auto width = static_cast<double>(begin - of_block.back() + kBlock);
    const auto whole = static_cast<double>(begin + kBlock);
    products += width * width;
    of_whole += whole * whole;
  }
  const bool is_whole = size_ <= kSmall || products > kWorth * of_whole;
  height_ = is_whole ? std::max<Index>(size_, 1) : kBlock;
  first_ = is_whole ? std::vector<Index>(size_ > 0 ? 1 : 0, 0) : of_block;
  for (size_t b = 0; b < first_.size(); ++b) {
    const Index begin = RowOf(b), count = std::min(height_, size_ - begin);
    rows_.emplace_back(Eigen::MatrixXd::Zero(count, begin + count - first_[b]));
  }
}

void EnvelopeMatrix::SetZero() {
  for (Eigen::MatrixXd& rows : rows_) rows.setZero();
}

Eigen::VectorXd EnvelopeMatrix::Diagonal() const {
  Eigen::VectorXd diagonal(size_);
  for (Index i = 0; i < size_; ++i) diagonal[i] = (*this)(i, i);
  return diagonal;
}

Eigen::MatrixXd EnvelopeMatrix::Symmetric() const {
  Eigen::MatrixXd both = Eigen::MatrixXd::Zero(size_, size_);
  for (size_t b = 0; b < rows_.size(); ++b) {
    both.block(RowOf(b), first_[b], rows_[b].rows(), rows_[b].cols()) = rows_[b];
  }
  both.triangularView<Eigen::StrictlyUpper>() = both.transpose();
  return both;
}

}  // namespace rigcal::server
