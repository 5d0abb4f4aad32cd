// SPDX-License-Identifier: Apache-2.0
#include "common/associate/motion_weights.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

namespace rigcal {
namespace {

// Rows that miss a neighbour or two make so many patterns; to look through them costs less than a
// tenth of an answer.
constexpr size_t kMaxRemembered = 48;

constexpr int kMaxTerms = 5;  // of a polynomial of degree 4

using Powers =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxMotionPoints, kMaxTerms>;
using Terms = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxTerms, 1>;
using Normal = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxTerms, kMaxTerms>;

// A velocity without the centre's noise may be this much noisier, in variance, before a lower
// degree is taken.
constexpr double kMaxNoiseGain = 2;

// The normal equations of a degree. Times are scaled to order one, where those of so few powers
// lose few digits.
struct Fit {
  Powers powers;
  Normal normal;
  Eigen::LDLT<Normal> factor;

  Fit(const PointWeights& times, double scale, Eigen::Index degree)
      : powers(times.size(), degree + 1) {
    for (Eigen::Index i = 0; i < times.size(); ++i) {
      double power = 1;
      for (Eigen::Index k = 0; k <= degree; ++k, power *= times[i] / scale) powers(i, k) = power;
    }
    normal = powers.transpose() * powers;
    factor.compute(normal);
  }
};

// Weights of P'(t), orthogonal to those of the centre where a polynomial of the degree of `fit`
// leaves the room; none where it does not. `plain`: those of P'(t) alone.
std::optional<PointWeights> VelocityWeights(const Fit& fit, double scale, double t,
                                            const PointWeights& centre, PointWeights* plain) {
  const Eigen::Index degree = fit.powers.cols() - 1;
  Terms slope = Terms::Zero(degree + 1);
  double power = 1 / scale;
  for (Eigen::Index k = 1; k <= degree; ++k, power *= t / scale) {
    slope[k] = static_cast<double>(k) * power;
  }
  const PointWeights velocity = fit.powers * fit.factor.solve(slope);
  *plain = velocity;
  const PointWeights rest =
      centre - fit.powers * fit.factor.solve(Terms(fit.powers.transpose() * centre));
  const double shared = centre.dot(velocity);
  if (shared * shared > (kMaxNoiseGain - 1) * velocity.squaredNorm() * rest.squaredNorm()) {
    return std::nullopt;
  }
  if (shared == 0) return velocity;
  return PointWeights(velocity - shared / rest.squaredNorm() * rest);
}

MotionWeights ComputeMotionWeights(const MotionQuery& query) {
  const PointWeights& times = query.times_s;
  const Eigen::Index degree = query.degree;
  const double scale = std::max(times.cwiseAbs().maxCoeff(), 1e-9);
  const Fit fit(times, scale, degree);
  Terms at = Terms::Zero(degree + 1);
  double power = 1;
  for (Eigen::Index k = 1; k <= degree; ++k) at[k] = power *= query.shift_s / scale;
  MotionWeights weights;
  weights.displacement = fit.powers * fit.factor.solve(at);
  const Normal lower = fit.normal.topLeftCorner(degree, degree);
  weights.lower_displacement =
      fit.powers.leftCols(degree) * Eigen::LDLT<Normal>(lower).solve(Terms(at.head(degree)));
  weights.centre = weights.displacement;
  if (query.own_index >= 0) weights.centre[query.own_index] += 1;

  PointWeights plain;
  std::optional<PointWeights> velocity =
      VelocityWeights(fit, scale, query.shift_s, weights.centre, &plain);
  for (Eigen::Index fewer = degree - 1; fewer >= 1 && !velocity; --fewer) {
    PointWeights unused;
    velocity =
        VelocityWeights(Fit(times, scale, fewer), scale, query.shift_s, weights.centre, &unused);
  }
  weights.velocity = velocity ? *velocity : plain;
  return weights;
}

}  // namespace

const MotionWeights& MotionWeightsMemory::Of(const MotionQuery& query) {
  for (const auto& [known, weights] : known_) {
    if (known == query) return weights;
  }
  if (known_.size() < kMaxRemembered) {
    return known_.emplace_back(query, ComputeMotionWeights(query)).second;
  }
  auto& oldest = known_[next_];
  next_ = (next_ + 1) % kMaxRemembered;
  oldest = {query, ComputeMotionWeights(query)};
  return oldest.second;
}

Eigen::Index CountDistinct(const PointWeights& times, double apart_s) {
  Eigen::Index count = times.size() == 0 ? 0 : 1, last = 0;
  for (Eigen::Index i = 1; i < times.size(); ++i) {
    if (std::abs(times[i] - times[last]) <= apart_s) continue;
    last = i;
    ++count;
  }
  return count;
}

}  // namespace rigcal
