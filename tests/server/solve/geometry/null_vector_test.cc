// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/null_vector.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <random>

namespace rigcal::server::null_vector_test {
namespace {

class NullVectorTest : public testing::TestWithParam<int> {};

// Equations of random coefficients, each of them made orthogonal to a known unit vector.
TEST_P(NullVectorTest, FindsTheSolutionOfHomogeneousEquations) {
  const int size = GetParam();
  std::mt19937_64 random(static_cast<uint64_t>(size));
  std::normal_distribution<double> normal;
  Eigen::VectorXd solution = Eigen::VectorXd::NullaryExpr(size, [&] { return normal(random); });
  solution.normalize();
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(size, size);
  for (int i = 0; i < 3 * size; ++i) {
    Eigen::VectorXd row = Eigen::VectorXd::NullaryExpr(size, [&] { return normal(random); });
    row -= solution.dot(row) * solution;
    matrix += row * row.transpose();
  }
  // Only the lower triangle counts.
  matrix.triangularView<Eigen::StrictlyUpper>().setConstant(std::nan(""));
  const Eigen::VectorXd found = NullVector(matrix);
  EXPECT_NEAR(found.norm(), 1, 1e-12);
  EXPECT_NEAR(std::abs(found.dot(solution)), 1, 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Sizes, NullVectorTest, testing::Values(2, 4, 9, kMaxNullVectorSize));

}  // namespace
}  // namespace rigcal::server::null_vector_test
