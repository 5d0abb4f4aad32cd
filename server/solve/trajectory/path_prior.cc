// SPDX-License-Identifier: Apache-2.0
#include "server/solve/trajectory/path_prior.h"

#include <algorithm>
#include <cmath>

#include "server/solve/trajectory/trajectory_spline.h"

namespace rigcal::server {
namespace {

// Keeps knots where they are that nothing reaches; nothing beside what one marker says.
constexpr double kKnotHold = 1e-4;  // 1/m^2
// The direction's length means nothing. Each knot's is held near one, by the sigma of the third
// differences over this: a path whose length is free is smooth where the directions are not.
constexpr double kLengthWeight = 4;

// By component of a knot.
double InverseSigma(const TrajectoryProblem& problem, Eigen::Index component) {
  return 1 / (component < 3 ? problem.origin_sigma : problem.direction_sigma);
}

// From knot k on.
double ThirdDifference(const TrajectorySpan& span, Eigen::Index k, Eigen::Index component) {
  double difference = 0;
  for (Eigen::Index a = 0; a < 4; ++a) {
    difference += kThirdDifference[a] * span.knots[(k + a) * span.size + component];
  }
  return difference;
}

}  // namespace

double PathPriorCost(const TrajectoryProblem& problem) {
  double cost = 0;
  for (const TrajectorySpan& span : problem.spans) {
    for (Eigen::Index k = 0; k + 4 <= span.knot_count(); ++k) {
      for (Eigen::Index c = 0; c < span.size; ++c) {
        cost += 0.5 * std::pow(InverseSigma(problem, c) * ThirdDifference(span, k, c), 2);
      }
    }
    if (!span.has_direction()) continue;
    for (Eigen::Index k = 0; k < span.knot_count(); ++k) {
      const double square = span.knots.segment<3>(k * span.size + 3).squaredNorm();
      cost += 0.5 * std::pow(0.5 * kLengthWeight / problem.direction_sigma * (square - 1), 2);
    }
  }
  return cost;
}

void AddPathPrior(const TrajectoryProblem& problem, size_t span_index, BandedMatrix* matrix,
                  Eigen::VectorXd* gradient) {
  const TrajectorySpan& span = problem.spans[span_index];
  for (Eigen::Index i = 0; i < span.knots.size(); ++i) (*matrix)(i, i) += kKnotHold;
  for (Eigen::Index k = 0; k + 4 <= span.knot_count(); ++k) {
    for (Eigen::Index c = 0; c < span.size; ++c) {
      const double information = std::pow(InverseSigma(problem, c), 2);
      const double difference = ThirdDifference(span, k, c);
      for (Eigen::Index a = 0; a < 4; ++a) {
        const Eigen::Index row = (k + a) * span.size + c;
        (*gradient)[row] += information * kThirdDifference[a] * difference;
        for (Eigen::Index b = 0; b <= a; ++b) {
          (*matrix)(row, (k + b) * span.size + c) +=
              information * kThirdDifference[a] * kThirdDifference[b];
        }
      }
    }
  }
  if (!span.has_direction()) return;
  const double weight = kLengthWeight / problem.direction_sigma;
  for (Eigen::Index k = 0; k < span.knot_count(); ++k) {
    const Eigen::Index first = k * span.size + 3;
    const Eigen::Vector3d direction = span.knots.segment<3>(first);
    const double residual = 0.5 * weight * (direction.squaredNorm() - 1);
    for (Eigen::Index i = 0; i < 3; ++i) {
      (*gradient)[first + i] += weight * residual * direction[i];
      for (Eigen::Index j = 0; j <= i; ++j) {
        (*matrix)(first + i, first + j) += weight * weight * direction[i] * direction[j];
      }
    }
  }
}

void AddPathFreedom(const TrajectoryProblem& problem, size_t span_index,
                    const BandedMatrix& covariance, PathFreedom* freedom) {
  const TrajectorySpan& span = problem.spans[span_index];
  BandedMatrix prior(span.knots.size(), 4 * span.size - 1);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(span.knots.size());
  AddPathPrior(problem, span_index, &prior, &gradient);
  BandedMatrix factor = prior;
  if (!factor.Factor()) return;
  const BandedMatrix without_data = factor.Inverse();
  // tr(A^-1 P): what the prior decides.
  for (Eigen::Index i = 0; i < span.knots.size(); ++i) {
    freedom->values += 1;
    for (Eigen::Index j = std::max<Eigen::Index>(0, i - prior.bandwidth()); j <= i; ++j) {
      freedom->values -= (i == j ? 1 : 2) * prior(i, j) * covariance(i, j);
    }
  }
  for (Eigen::Index k = 0; k + 4 <= span.knot_count(); ++k) {
    for (Eigen::Index c = 0; c < span.size; ++c) {
      double variance = 0;
      for (Eigen::Index a = 0; a < 4; ++a) {
        const Eigen::Index i = (k + a) * span.size + c;
        for (Eigen::Index b = 0; b <= a; ++b) {
          const Eigen::Index j = (k + b) * span.size + c;
          variance += (a == b ? 1 : 2) * kThirdDifference[a] * kThirdDifference[b] *
                      (without_data(i, j) - covariance(i, j));
        }
      }
      const double difference = ThirdDifference(span, k, c);
      const double by_data = variance * std::pow(InverseSigma(problem, c), 2);
      (c < 3 ? freedom->origin_by_data : freedom->direction_by_data) += by_data;
      (c < 3 ? freedom->origin_square : freedom->direction_square) += difference * difference;
    }
  }
}

}  // namespace rigcal::server
