// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/envelope_cholesky.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>
#include <vector>

namespace rigcal::server {

using Eigen::Index;

EnvelopeCholesky::EnvelopeCholesky(EnvelopeMatrix matrix) : factor_(std::move(matrix)) {
  ok_ = Factorise();
}

bool EnvelopeCholesky::Factorise() {
  for (size_t b = 0; b < factor_.block_count(); ++b) {
    Eigen::MatrixXd& own = factor_.rows(b);
    const Index own_first = factor_.FirstOf(b), own_count = factor_.CountOf(b);
    for (size_t other = factor_.BlockOf(own_first); other < b; ++other) {
      const Eigen::MatrixXd& above = factor_.rows(other);
      const Index column = factor_.RowOf(other), count = factor_.CountOf(other);
      const Index from = std::max(own_first, factor_.FirstOf(other));
      auto block = own.middleCols(column - own_first, count);
      if (column > from) {
        block.noalias() -=
            own.middleCols(from - own_first, column - from) *
            above.middleCols(from - factor_.FirstOf(other), column - from).transpose();
      }
      above.rightCols(count)
          .triangularView<Eigen::Lower>()
          .transpose()
          .solveInPlace<Eigen::OnTheRight>(block);
    }
    const Index before = factor_.RowOf(b) - own_first;
    if (before > 0) {
      own.rightCols(own_count).selfadjointView<Eigen::Lower>().rankUpdate(own.leftCols(before), -1);
    }
    Eigen::Ref<Eigen::MatrixXd> diagonal = own.rightCols(own_count);
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>, Eigen::Lower> factor(diagonal);
    if (factor.info() != Eigen::Success) return false;
  }
  return true;
}

void EnvelopeCholesky::SolveLowerInPlace(Eigen::MatrixXd* right) const {
  for (size_t b = 0; b < factor_.block_count(); ++b) {
    const Index begin = factor_.RowOf(b), count = factor_.CountOf(b), first = factor_.FirstOf(b);
    const Eigen::MatrixXd& rows = factor_.rows(b);
    auto own = right->middleRows(begin, count);
    if (begin > first) {
      own.noalias() -= rows.leftCols(begin - first) * right->middleRows(first, begin - first);
    }
    rows.rightCols(count).triangularView<Eigen::Lower>().solveInPlace(own);
  }
}

void EnvelopeCholesky::SolveInPlace(Eigen::MatrixXd* right) const {
  SolveLowerInPlace(right);
  for (size_t b = factor_.block_count(); b-- > 0;) {
    const Index begin = factor_.RowOf(b), count = factor_.CountOf(b), first = factor_.FirstOf(b);
    const Eigen::MatrixXd& rows = factor_.rows(b);
    auto own = right->middleRows(begin, count);
    rows.rightCols(count).triangularView<Eigen::Lower>().transpose().solveInPlace(own);
    if (begin > first) {
      right->middleRows(first, begin - first).noalias() -=
          rows.leftCols(begin - first).transpose() * own;
    }
  }
}

Eigen::VectorXd EnvelopeCholesky::Solve(const Eigen::VectorXd& right) const {
  if (IsWhole() && size() > 0) {
    Eigen::VectorXd solved = right;
    factor_.rows(0).triangularView<Eigen::Lower>().solveInPlace(solved);
    factor_.rows(0).triangularView<Eigen::Lower>().transpose().solveInPlace(solved);
    return solved;
  }
  Eigen::MatrixXd solved = right;
  SolveInPlace(&solved);
  return solved.col(0);
}

Eigen::MatrixXd EnvelopeCholesky::Inverse() const {
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(size(), size());
  SolveInPlace(&inverse);
  return inverse;
}

EnvelopeMatrix EnvelopeCholesky::InverseWithin() const {
  EnvelopeMatrix inverse = factor_;
  if (IsWhole()) {
    if (size() > 0) inverse.rows(0) = Inverse();
    return inverse;
  }
  // Block (row, column), row >= column.
  const auto block = [&inverse](size_t row, size_t column) {
    return inverse.rows(row).middleCols(inverse.RowOf(column) - inverse.FirstOf(row),
                                        inverse.CountOf(column));
  };
  for (size_t b = inverse.block_count(); b-- > 0;) {
    const Eigen::MatrixXd diagonal = block(b, b);
    const auto lower = diagonal.triangularView<Eigen::Lower>();
    std::vector<size_t> below;  // blocks of rows that reach this column
    std::vector<Eigen::MatrixXd> scaled;
    for (size_t r = b + 1; r < inverse.block_count(); ++r) {
      if (inverse.FirstOf(r) > inverse.RowOf(b)) continue;
      below.push_back(r);
      lower.solveInPlace<Eigen::OnTheRight>(scaled.emplace_back(block(r, b)));
    }
    for (const size_t r : below) {
      auto own = block(r, b);
      own.setZero();
      for (size_t i = 0; i < below.size(); ++i) {
        if (below[i] <= r) {
          own.noalias() -= block(r, below[i]) * scaled[i];
        } else {
          own.noalias() -= block(below[i], r).transpose() * scaled[i];
        }
      }
    }
    Eigen::MatrixXd own = Eigen::MatrixXd::Identity(diagonal.rows(), diagonal.cols());
    lower.solveInPlace(own);
    lower.transpose().solveInPlace(own);
    for (size_t i = 0; i < below.size(); ++i) {
      own.noalias() -= scaled[i].transpose() * block(below[i], b);
    }
    block(b, b) = 0.5 * (own + own.transpose());
  }
  return inverse;
}

}  // namespace rigcal::server
