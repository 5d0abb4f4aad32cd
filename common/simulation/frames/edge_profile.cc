// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/edge_profile.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace rigcal {
namespace {

constexpr int kDirections = 16;
constexpr int kDiscSteps = 24;
constexpr double kGaussianReach = 4.5;

// Offsets along the edge's normal and their weights: one distribution of the blur.
struct Spread {
  std::vector<double> offset_px;
  std::vector<double> weight;
};

// The disc's light by distance from its middle along one direction: equal areas by the substitution
// that takes the circle's square root away.
Spread DiscSpread(double radius_px) {
  Spread spread;
  const int steps = radius_px > 0 ? kDiscSteps : 1;
  for (int i = 0; i < steps; ++i) {
    const double angle = std::numbers::pi * (i + 0.5) / steps;
    spread.offset_px.push_back(radius_px > 0 ? radius_px * std::cos(angle) : 0);
    spread.weight.push_back(radius_px > 0 ? std::sin(angle) * std::sin(angle) : 1);
  }
  double sum = 0;
  for (const double weight : spread.weight) sum += weight;
  for (double& weight : spread.weight) weight /= sum;
  return spread;
}

// Area of the unit square about the origin on the side x <= t of a line of normal (cos, sin), 0 to
// 45 degrees: the integral of a trapezoid.
double SquareShare(double t, double cosine, double sine) {
  const double half = 0.5 * (cosine + sine), flat = 0.5 * (cosine - sine);
  if (t <= -half) return 0;
  if (t >= half) return 1;
  if (std::abs(t) <= flat) return 0.5 + t / cosine;
  const double corner = half - std::abs(t);
  const double rest = 0.5 * corner * corner / (cosine * sine);
  return t < 0 ? rest : 1 - rest;
}

// The step blurred by square and Gaussian, for one direction of the edge.
double SquareGaussianShare(double t, double cosine, double sine, double sigma) {
  if (sigma < 0.02) return SquareShare(t, cosine, sine);
  // Twice the box: the mean of the Gaussian's distribution over the square's two projected sides.
  constexpr int kSteps = 6;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const double offset = cosine * ((i + 0.5) / kSteps - 0.5) + sine * ((j + 0.5) / kSteps - 0.5);
      sum += 0.5 * std::erfc(-(t - offset) / (sigma * std::numbers::sqrt2));
    }
  }
  return sum / (kSteps * kSteps);
}

double Share(double t, double gaussian_px, const Spread& disc) {
  double sum = 0;
  for (size_t k = 0; k < disc.weight.size(); ++k) {
    double mean = 0;
    for (int i = 0; i < kDirections; ++i) {
      const double angle = 0.25 * std::numbers::pi * (i + 0.5) / kDirections;
      mean +=
          SquareGaussianShare(t - disc.offset_px[k], std::cos(angle), std::sin(angle), gaussian_px);
    }
    sum += disc.weight[k] * mean / kDirections;
  }
  return sum;
}

}  // namespace

EdgeProfile::EdgeProfile(double gaussian_px, double disc_px)
    : variance_px2_(gaussian_px * gaussian_px + disc_px * disc_px / 4 + 1.0 / 12) {
  const double reach = 0.75 + kGaussianReach * gaussian_px + disc_px;
  const auto half = static_cast<size_t>(std::ceil(reach * kStepsPerPx));
  reach_px_ = static_cast<float>(half) / kStepsPerPx;
  last_ = static_cast<float>(2 * half);
  table_.resize(2 * half + 2, 1.0f);
  const Spread disc = DiscSpread(disc_px);
  for (size_t i = 0; i <= half; ++i) {
    const double t = (static_cast<double>(i) - static_cast<double>(half)) / kStepsPerPx;
    const double share = std::clamp(Share(t, gaussian_px, disc), 0.0, 0.5);
    table_[i] = static_cast<float>(share);
    table_[2 * half - i] = static_cast<float>(1 - share);
  }
}

}  // namespace rigcal
