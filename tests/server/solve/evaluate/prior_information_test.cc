// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/prior_information.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/server/solve/exact_problem.h"

namespace rigcal::server::prior_information_test {
namespace {

using Kind = ReducedParameterKind;

TEST(PriorInformationTest, IsTheInverseSquareOfEachSigma) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {});
  problem.cameras[1].intrinsics_sigma =
      IntrinsicsVector::Zero(problem.cameras[1].intrinsics.size());
  problem.cameras[1].intrinsics_sigma[2] = 4;
  problem.cameras[1].line_delay_sigma_s = 1e-4;
  problem.clocks[0].offset_sigma_s = 0.5;
  problem.clocks[0].rate_sigma = 2e-4;
  const Eigen::MatrixXd prior =
      PriorInformation(problem, {{Kind::kRotation, 1, 0},
                                 {Kind::kIntrinsic, 1, 2},
                                 {Kind::kIntrinsic, 1, 3},  // sigma 0: no prior
                                 {Kind::kLineDelay, 1, 0},
                                 {Kind::kTimeOffset, 0, 0},
                                 {Kind::kTimeRate, 0, 0}});
  Eigen::VectorXd expected(6);
  expected << 0, 1.0 / 16, 0, 1e8, 4, 2.5e7;
  EXPECT_TRUE(prior.isApprox(Eigen::MatrixXd(expected.asDiagonal()), 1e-12)) << prior;
}

// For displacements d of the markers d^T P d is the sum over the spans of their squares.
TEST(PriorInformationTest, OfAWandIsThatOfItsSpans) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {});
  problem.target.fixed = false;
  problem.target.span_sigma_m = 0.002;
  const Eigen::MatrixXd prior = PriorInformation(
      problem, {{Kind::kMarkerPosition, 2, 0}, {Kind::kMarkerPosition, 1, 0}});  // in any order
  const Eigen::Vector2d moved(0.005, 0.001);  // the last marker, the middle one
  EXPECT_NEAR(moved.dot(prior * moved), std::pow(0.001 / 0.002, 2) + std::pow(0.004 / 0.002, 2),
              1e-9);
  EXPECT_EQ(prior, prior.transpose());
}

}  // namespace
}  // namespace rigcal::server::prior_information_test
