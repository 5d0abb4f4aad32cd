// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/loss_factors.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

// Freedom of a rigid target, a line and a point.
constexpr int kRigidParameters = 6, kLineParameters = 5, kPointParameters = 3;

// |r|^2 of the whitened residuals of an instant's markers that are used.
struct SquaredNorm {
  double value, noise_share;
};
std::vector<SquaredNorm> SquaredNorms(const BuiltProblem& built, const BundleInstant& instant) {
  const BundleProblem& problem = built.problem;
  std::vector<SquaredNorm> squares;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      const auto residual = MarkerResidualPx(problem, instant, observation, marker);
      if (!marker.used || !residual) continue;
      squares.push_back({(marker.sqrt_information * *residual).squaredNorm(),
                         built.sources[problem.IndexOf(marker)].noise_share});
    }
  }
  return squares;
}

}  // namespace

void LossSum::Add(double square, double noise_share, double leverage) {
  weight_ += 1 / (1 + square / c2_);
  const double s = square / (noise_share * (1 - leverage));
  const double w = 1 / (1 + s / c2_);
  // The derivative of psi has the eigenvalues w, across the residual, and 2 w^2 - w along it.
  slope_ += w * w;
  slope_square_ += w * w * (1 + 2 * w * (w - 1));
  taken_ += leverage;
  square_ += 0.5 * w * w * s;
  count_ += 1;
}

LossFactors LossSum::Factors(double free) const {
  if (2 * count_ <= free || !(slope_ > 0)) return {};
  const double spread = slope_square_ * count_ / (slope_ * slope_) - 1;
  const double correction = 1 + taken_ / count_ * spread;
  return {correction * correction * weight_ * square_ / (slope_ * slope_), slope_ / weight_};
}

LossFactors MeasureLossFactors(const BuiltProblem& built, double loss_scale, Eigen::Index free) {
  const BundleProblem& problem = built.problem;
  const auto freedom_of = [&problem](const BundleInstant& instant) {
    return instant.is_point || problem.IsPoint() ? kPointParameters
           : instant.is_rigid                    ? kRigidParameters
                                                 : kLineParameters;
  };
  double count = 0, freedom = 0;
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    freedom += freedom_of(instant);
    count += static_cast<double>(SquaredNorms(built, instant).size());
  }
  const double shared = count > 0 ? static_cast<double>(free) / (2 * count) : 1;
  LossSum sum(loss_scale);
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    const std::vector<SquaredNorm> squares = SquaredNorms(built, instant);
    const double leverage = std::min(
        kMaxLeverage, shared + 0.5 * freedom_of(instant) /
                                   static_cast<double>(std::max<size_t>(1, squares.size())));
    for (const auto& [raw, noise_share] : squares) sum.Add(raw, noise_share, leverage);
  }
  return sum.Factors(freedom + static_cast<double>(free));
}

}  // namespace rigcal::server
