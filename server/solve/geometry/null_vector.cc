// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/null_vector.h"

#include <Eigen/Eigenvalues>

namespace rigcal::server {

Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxNullVectorSize, 1> NullVector(
    const Eigen::Ref<const Eigen::MatrixXd>& normal) {
  using Normal = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxNullVectorSize,
                               kMaxNullVectorSize>;
  // Eigenvalues come in increasing order.
  return Eigen::SelfAdjointEigenSolver<Normal>(normal).eigenvectors().col(0);
}

}  // namespace rigcal::server
