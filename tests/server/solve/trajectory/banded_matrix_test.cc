// SPDX-License-Identifier: Apache-2.0
#include "server/solve/trajectory/banded_matrix.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

namespace rigcal::server::banded_matrix_test {
namespace {

constexpr Eigen::Index kSize = 17, kBandwidth = 4;

// A positive definite matrix, and the same in full.
BandedMatrix Make(Eigen::MatrixXd* full) {
  BandedMatrix matrix(kSize, kBandwidth);
  *full = Eigen::MatrixXd::Zero(kSize, kSize);
  for (Eigen::Index i = 0; i < kSize; ++i) {
    for (Eigen::Index j = std::max<Eigen::Index>(0, i - kBandwidth); j <= i; ++j) {
      const double value =
          i == j ? 5 + 0.1 * static_cast<double>(i) : std::sin(static_cast<double>(3 * i + 7 * j));
      matrix(i, j) = (*full)(i, j) = (*full)(j, i) = value;
    }
  }
  return matrix;
}

TEST(BandedMatrixTest, SolvesAsTheFullMatrix) {
  Eigen::MatrixXd full;
  BandedMatrix matrix = Make(&full);
  ASSERT_TRUE(matrix.Factor());
  Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(kSize, -1, 2);
  const Eigen::VectorXd expected = full.inverse() * x;
  matrix.SolveLower(x);
  matrix.SolveUpper(x);
  EXPECT_LT((x - expected).norm(), 1e-12);
}

TEST(BandedMatrixTest, InverseHasTheFullInversesBand) {
  Eigen::MatrixXd full;
  BandedMatrix matrix = Make(&full);
  ASSERT_TRUE(matrix.Factor());
  const BandedMatrix inverse = matrix.Inverse();
  const Eigen::MatrixXd expected = full.inverse();
  for (Eigen::Index i = 0; i < kSize; ++i) {
    for (Eigen::Index j = std::max<Eigen::Index>(0, i - kBandwidth); j <= i; ++j) {
      EXPECT_NEAR(inverse(i, j), expected(i, j), 1e-12);
    }
  }
}

TEST(BandedMatrixTest, FindsThatAMatrixIsIndefinite) {
  Eigen::MatrixXd full;
  BandedMatrix matrix = Make(&full);
  matrix(8, 8) = -1;
  EXPECT_FALSE(matrix.Factor());
}

}  // namespace
}  // namespace rigcal::server::banded_matrix_test
