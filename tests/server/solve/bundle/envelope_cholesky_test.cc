// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/envelope_cholesky.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "common/simulation/world/random_stream.h"

namespace rigcal::server {
namespace {

// Information of cameras in a hall: each shares instants with those up to three places away, and
// all share the last two parameters.
Eigen::MatrixXd HallInformation(int cameras) {
  constexpr int kOwn = 6, kShared = 2;
  const Eigen::Index size = kOwn * cameras + kShared;
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(size, size);
  RandomStream random{7};
  for (int place = 0; place + 3 < cameras; ++place) {
    Eigen::VectorXd row = Eigen::VectorXd::Zero(size);
    for (int instant = 0; instant < 4 * kOwn; ++instant) {
      for (int near = 0; near <= 3; ++near) {
        for (int i = 0; i < kOwn; ++i) row[kOwn * (place + near) + i] = random.Gaussian();
      }
      for (int i = 0; i < kShared; ++i) row[size - 1 - i] = random.Gaussian();
      information += row * row.transpose();
    }
  }
  return information;
}

Eigen::MatrixXd LowerOf(const Eigen::MatrixXd& matrix) {
  Eigen::MatrixXd lower = matrix.triangularView<Eigen::Lower>();
  return lower;
}

TEST(EnvelopeCholesky, SolvesALargeSparseMatrixAsTheWholeFactorDoes) {
  const Eigen::MatrixXd information = HallInformation(100);
  const EnvelopeCholesky factor(LowerOf(information));
  ASSERT_TRUE(factor.ok());
  EXPECT_FALSE(factor.IsWhole());
  const Eigen::LLT<Eigen::MatrixXd> whole(information);
  const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(information.rows(), -1, 3);
  EXPECT_LT((factor.Solve(right) - whole.solve(right)).norm(), 1e-12 * whole.solve(right).norm());
  const Eigen::MatrixXd inverse = information.inverse();
  EXPECT_LT((factor.Inverse() - inverse).norm(), 1e-11 * inverse.norm());
}

TEST(EnvelopeCholesky, InvertsWithinTheEnvelope) {
  for (const int cameras : {8, 100}) {
    const Eigen::MatrixXd information = HallInformation(cameras);
    const EnvelopeCholesky factor(LowerOf(information));
    ASSERT_TRUE(factor.ok());
    const EnvelopeMatrix within = factor.InverseWithin();
    EXPECT_EQ(within.IsWhole(), cameras == 8);
    const Eigen::MatrixXd inverse = information.inverse();
    int compared = 0;
    for (Eigen::Index row = 0; row < information.rows(); ++row) {
      EXPECT_NEAR(within.Diagonal()[row], inverse(row, row), 1e-12 * inverse.norm());
      for (Eigen::Index column = 0; column <= row; ++column) {
        if (information(row, column) == 0) continue;
        ++compared;
        ASSERT_NEAR(within(row, column), inverse(row, column), 1e-12 * inverse.norm())
            << cameras << " cameras, " << row << ", " << column;
      }
    }
    EXPECT_GE(compared, 100 * cameras);
  }
}

TEST(EnvelopeCholesky, SolvesByTheFactorAlone) {
  for (const int cameras : {8, 100}) {
    const Eigen::MatrixXd information = HallInformation(cameras);
    const EnvelopeCholesky factor(LowerOf(information));
    Eigen::MatrixXd half = Eigen::MatrixXd::Identity(information.rows(), 3);
    factor.SolveLowerInPlace(&half);
    const Eigen::Matrix3d inverse = information.inverse().topLeftCorner<3, 3>();
    EXPECT_LT((half.transpose() * half - inverse).norm(), 1e-11 * inverse.norm());
  }
}

TEST(EnvelopeCholesky, SmallAndDenseMatricesAreFactorisedAsTheyAre) {
  const Eigen::MatrixXd small = HallInformation(16);
  Eigen::MatrixXd dense = Eigen::MatrixXd::Random(400, 500);
  dense = (dense * dense.transpose()).eval();
  for (const Eigen::MatrixXd& matrix : {small, dense}) {
    const EnvelopeCholesky factor(matrix);
    ASSERT_TRUE(factor.ok());
    EXPECT_TRUE(factor.IsWhole());
    const Eigen::VectorXd right = Eigen::VectorXd::Ones(matrix.rows());
    EXPECT_EQ(factor.Solve(right), Eigen::LLT<Eigen::MatrixXd>(matrix).solve(right));
    const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(matrix.rows(), matrix.rows());
    EXPECT_EQ(factor.Inverse(), Eigen::LLT<Eigen::MatrixXd>(matrix).solve(unit));
  }
}

TEST(EnvelopeCholesky, SaysThatAMatrixIsNotPositiveDefinite) {
  for (const int cameras : {8, 100}) {
    Eigen::MatrixXd information = HallInformation(cameras);
    information(20, 20) = -1;
    EXPECT_FALSE(EnvelopeCholesky(information).ok());
  }
}

}  // namespace
}  // namespace rigcal::server
