// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/logistic_fit.h"

#include <gtest/gtest.h>

#include <random>

namespace rigcal::accuracy::logistic_fit_test {
namespace {

std::vector<LogisticSample> Samples(const LogisticModel& truth, int count) {
  std::mt19937 random(5);
  std::exponential_distribution<double> doubt(0.5);
  std::uniform_real_distribution<double> uniform;
  std::vector<LogisticSample> samples;
  for (int i = 0; i < count; ++i) {
    LogisticSample sample{.doubts = Eigen::VectorXd(truth.weights.size())};
    for (double& value : sample.doubts) value = doubt(random);
    sample.is_positive = uniform(random) < 1 / (1 + std::exp(-truth.LogOdds(sample.doubts)));
    samples.push_back(std::move(sample));
  }
  return samples;
}

TEST(FitLogistic, FindsTheModelThatTheSamplesAreOf) {
  const LogisticModel truth{3, Eigen::Vector3d(1, 0.5, 0)};
  const LogisticModel prior{0, Eigen::Vector3d(0.1, 0.1, 0.1)};
  const LogisticModel fitted =
      FitLogistic(Samples(truth, 20000), prior, Eigen::Vector3d::Constant(10), 10);
  EXPECT_NEAR(fitted.bias, 3, 0.2);
  EXPECT_LT((fitted.weights - truth.weights).norm(), 0.1);
}

TEST(FitLogistic, KeepsThePriorWhereNothingIsKnown) {
  const LogisticModel prior{1, Eigen::Vector2d(0.3, 0.7)};
  const LogisticModel fitted = FitLogistic({}, prior, Eigen::Vector2d::Ones(), 1);
  EXPECT_NEAR(fitted.bias, 1, 1e-9);
  EXPECT_LT((fitted.weights - prior.weights).norm(), 1e-9);
}

// More of a doubt never makes a wand likelier, whatever the samples say.
TEST(FitLogistic, WeightsAreNotNegative) {
  const LogisticModel truth{0, Eigen::Vector2d(1, -2)};
  const LogisticModel prior{0, Eigen::Vector2d(1, 1)};
  const LogisticModel fitted =
      FitLogistic(Samples(truth, 5000), prior, Eigen::Vector2d::Constant(3), 3);
  EXPECT_EQ(fitted.weights[1], 0);
}

// Of samples that a plane parts the prior keeps the weights finite.
TEST(FitLogistic, EndsWhereTheClassesAreParted) {
  std::vector<LogisticSample> samples;
  for (int i = 0; i < 100; ++i) {
    samples.push_back({.doubts = Eigen::VectorXd::Constant(1, i), .is_positive = i < 50});
  }
  const LogisticModel fitted =
      FitLogistic(samples, {0, Eigen::VectorXd::Ones(1)}, Eigen::VectorXd::Ones(1), 10);
  EXPECT_LT(fitted.weights[0], 10);
  EXPECT_GT(fitted.LogOdds(Eigen::VectorXd::Constant(1, 40)), 1);
  EXPECT_LT(fitted.LogOdds(Eigen::VectorXd::Constant(1, 60)), -1);
}

}  // namespace
}  // namespace rigcal::accuracy::logistic_fit_test
