// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/logistic_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace rigcal::accuracy {
namespace {

constexpr int kMostSteps = 200;
constexpr double kSettled = 1e-8;

// Of the negative logarithm of the posterior.
double Loss(const std::vector<LogisticSample>& samples, const LogisticModel& model,
            const Eigen::VectorXd& away, const Eigen::VectorXd& precisions) {
  double loss = 0.5 * away.dot(precisions.cwiseProduct(away));
  for (const LogisticSample& sample : samples) {
    const double margin = (sample.is_positive ? 1 : -1) * model.LogOdds(sample.doubts);
    // log(1 + exp(-margin)) without overflow.
    loss += std::max(0.0, -margin) + std::log1p(std::exp(-std::abs(margin)));
  }
  return loss;
}

}  // namespace

LogisticModel FitLogistic(const std::vector<LogisticSample>& samples, const LogisticModel& prior,
                          const Eigen::VectorXd& weight_sigmas, double bias_sigma) {
  const Eigen::Index count = prior.weights.size();
  // The bias is the last parameter.
  Eigen::VectorXd before(count + 1), precisions(count + 1);
  before << prior.weights, prior.bias;
  precisions << weight_sigmas.cwiseAbs2().cwiseInverse(), 1 / (bias_sigma * bias_sigma);
  Eigen::VectorXd now = before;
  const auto model_of = [&](const Eigen::VectorXd& q) {
    return LogisticModel{q[count], q.head(count)};
  };
  double loss = Loss(samples, prior, now - before, precisions);
  for (int step = 0; step < kMostSteps; ++step) {
    const LogisticModel model = model_of(now);
    Eigen::VectorXd gradient = precisions.cwiseProduct(now - before);
    Eigen::MatrixXd hessian = precisions.asDiagonal();
    for (const LogisticSample& sample : samples) {
      const double probability = 1 / (1 + std::exp(-model.LogOdds(sample.doubts)));
      Eigen::VectorXd direction(count + 1);
      direction << -sample.doubts, 1;
      gradient += (probability - (sample.is_positive ? 1 : 0)) * direction;
      hessian.selfadjointView<Eigen::Lower>().rankUpdate(direction,
                                                         probability * (1 - probability));
    }
    hessian.triangularView<Eigen::StrictlyUpper>() = hessian.transpose();
    // At the border a weight moves only inwards.
    for (Eigen::Index k = 0; k < count; ++k) {
      if (now[k] > 0 || gradient[k] < 0) continue;
      hessian.row(k).setZero();
      hessian.col(k).setZero();
      hessian(k, k) = 1;
      gradient[k] = 0;
    }
    const Eigen::VectorXd full = -hessian.ldlt().solve(gradient);
    double share = 1;
    Eigen::VectorXd next;
    double its_loss = 0;
    do {
      next = now + share * full;
      next.head(count) = next.head(count).cwiseMax(0);
      its_loss = Loss(samples, model_of(next), next - before, precisions);
      share *= 0.5;
    } while (its_loss > loss && share > 1e-6);
    if (!(its_loss < loss - kSettled * (1 + loss))) break;
    now = next;
    loss = its_loss;
  }
  return model_of(now);
}

}  // namespace rigcal::accuracy
