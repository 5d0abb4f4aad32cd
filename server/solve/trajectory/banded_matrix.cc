// SPDX-License-Identifier: Apache-2.0
#include "server/solve/trajectory/banded_matrix.h"

#include <algorithm>
#include <cmath>

namespace rigcal::server {

bool BandedMatrix::Factor() {
  for (Eigen::Index j = 0; j < size(); ++j) {
    if (!(values_(0, j) > 0)) return false;
    const Eigen::Index reach = std::min(bandwidth(), size() - 1 - j);
    const double root = std::sqrt(values_(0, j));
    values_.col(j).head(reach + 1) /= root;
    for (Eigen::Index k = 1; k <= reach; ++k) {
      values_.col(j + k).head(reach - k + 1) -=
          values_(k, j) * values_.col(j).segment(k, reach - k + 1);
    }
  }
  return true;
}

void BandedMatrix::SolveLower(Eigen::Ref<Eigen::MatrixXd> x) const {
  for (Eigen::Index c = 0; c < x.cols(); ++c) {
    for (Eigen::Index j = 0; j < size(); ++j) {
      const double value = x(j, c) /= values_(0, j);
      if (value == 0) continue;
      const Eigen::Index reach = std::min(bandwidth(), size() - 1 - j);
      x.col(c).segment(j + 1, reach) -= value * values_.col(j).segment(1, reach);
    }
  }
}

void BandedMatrix::SolveUpper(Eigen::Ref<Eigen::VectorXd> x) const {
  for (Eigen::Index j = size() - 1; j >= 0; --j) {
    const Eigen::Index reach = std::min(bandwidth(), size() - 1 - j);
    x[j] -= values_.col(j).segment(1, reach).dot(x.segment(j + 1, reach));
    x[j] /= values_(0, j);
  }
}

BandedMatrix BandedMatrix::Inverse() const {
  BandedMatrix inverse(size(), bandwidth());
  for (Eigen::Index j = size() - 1; j >= 0; --j) {
    const Eigen::Index reach = std::min(bandwidth(), size() - 1 - j);
    for (Eigen::Index i = j + reach; i >= j; --i) {
      double sum = i == j ? 1 / values_(0, j) : 0;
      for (Eigen::Index k = j + 1; k <= j + reach; ++k) {
        sum -= values_(k - j, j) * inverse(std::max(i, k), std::min(i, k));
      }
      inverse(i, j) = sum / values_(0, j);
    }
  }
  return inverse;
}

}  // namespace rigcal::server
