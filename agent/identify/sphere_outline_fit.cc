// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/sphere_outline_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigcal::agent {
namespace {

enum Parameter : int {
  kX,
  kY,
  kRadius,
  kStretch,     // p
  kShear,       // q
  kEdge,        // s, px^2
  kEdgeCos,     // b
  kEdgeSin,     // c
  kBrightness,  // a
  kSlopeX,      // g
  kSlopeY,
  kBendAlong,     // h1
  kBendDiagonal,  // h2
  kBendRound,     // h3
  kCount
};
using Vector = Eigen::Matrix<double, kCount, 1>;
using Matrix = Eigen::Matrix<double, kCount, kCount>;

// What is expected of the parameters, one sigma. Not of the place.
constexpr double kShapeSigma = 0.04, kEdgeSigma = 0.5, kEdgeShapeSigma = 0.5;
constexpr double kSlopeSigma = 0.5, kNoSlopeSigma = 1e-4, kBendSigma = 0.3;
constexpr double kUsualEdgePx2 = 0.5;  // a pixel's own width and a little blur
constexpr double kModelNoise = 0.015;  // of the model itself
constexpr double kCauchy = 2.4;        // sigmas
constexpr size_t kFewest = kCount + 8;
constexpr int kMaxRounds = 30;
constexpr double kSettledPx = 0.003, kSettledCost = 0.05;
constexpr double kFarEdge = 4.5;  // sigmas from the outline, where nothing depends on it
constexpr double kMostResidual = 0.12;

struct Model {
  double value = 0;
  Vector slope = Vector::Zero();
};

double NormalShare(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

// Value and derivatives at one pixel.
void Evaluate(const Vector& q, const Eigen::Vector2d& at, Model* model) {
  const double radius = q[kRadius];
  Eigen::Matrix2d w;
  w << 1 + q[kStretch], q[kShear], q[kShear], 1 - q[kStretch];
  w /= radius;
  const Eigen::Vector2d d = at - q.head<2>(), u = w * d;
  const double n = std::max(u.norm(), 1e-9);
  const Eigen::Vector2d gradient = w * u / n;  // of n; w is symmetric
  const double steep = std::max(gradient.norm(), 1e-9);
  const Eigen::Vector2d normal = gradient / steep;
  const double rho = (1 - n) / steep;
  const double cos2 = normal.x() * normal.x() - normal.y() * normal.y();
  const double sin2 = 2 * normal.x() * normal.y();
  const double shape = std::max(0.05, 1 + q[kEdgeCos] * cos2 + q[kEdgeSin] * sin2);
  const double sigma = std::sqrt(q[kEdge] * shape);
  const double z = rho / sigma;
  model->slope.setZero();
  if (z < -kFarEdge) {
    model->value = 0;
    return;
  }
  const double cover = z > kFarEdge ? 1 : NormalShare(z);
  // Shading does not go on beyond the outline.
  const double clip = n > 1 ? 1 / n : 1;
  const Eigen::Vector2d v = clip * u;
  const double along = v.x() * v.x() - v.y() * v.y(), diagonal = 2 * v.x() * v.y();
  const double round = v.squaredNorm() - 0.5;
  const double light = q[kBrightness] + q[kSlopeX] * v.x() + q[kSlopeY] * v.y() +
                       q[kBendAlong] * along + q[kBendDiagonal] * diagonal + q[kBendRound] * round;
  model->value = cover * light;
  Vector& s = model->slope;
  s[kBrightness] = cover;
  s[kSlopeX] = cover * v.x();
  s[kSlopeY] = cover * v.y();
  s[kBendAlong] = cover * along;
  s[kBendDiagonal] = cover * diagonal;
  s[kBendRound] = cover * round;
  if (n <= 1) {
    const Eigen::Vector2d of_light(q[kSlopeX] + 2 * q[kBendAlong] * v.x() +
                                       2 * q[kBendDiagonal] * v.y() + 2 * q[kBendRound] * v.x(),
                                   q[kSlopeY] - 2 * q[kBendAlong] * v.y() +
                                       2 * q[kBendDiagonal] * v.x() + 2 * q[kBendRound] * v.y());
    const Eigen::Vector2d by_place = -cover * (w * of_light);
    s[kX] = by_place.x();
    s[kY] = by_place.y();
    s[kRadius] = -cover * of_light.dot(u) / radius;
  }
  if (z > kFarEdge) return;
  const double density =
      std::exp(-0.5 * z * z) / (sigma * std::sqrt(2 * std::numbers::pi));  // d cover / d rho
  const double edge = light * density;
  s[kX] += edge * normal.x();
  s[kY] += edge * normal.y();
  s[kRadius] += edge * n / (radius * steep);
  const Eigen::Vector2d by_stretch(d.x() / radius, -d.y() / radius);
  const Eigen::Vector2d by_shear(d.y() / radius, d.x() / radius);
  s[kStretch] = -edge * u.dot(by_stretch) / (n * steep);
  s[kShear] = -edge * u.dot(by_shear) / (n * steep);
  const double by_sigma = -edge * z;
  s[kEdge] = by_sigma * 0.5 * sigma / q[kEdge];
  s[kEdgeCos] = by_sigma * 0.5 * q[kEdge] * cos2 / sigma;
  s[kEdgeSin] = by_sigma * 0.5 * q[kEdge] * sin2 / sigma;
}

// Normal equations of the robust cost.
struct System {
  Matrix information = Matrix::Zero();  // lower triangle
  Vector gradient = Vector::Zero();     // downhill
  double cost = 0;
  // Sums over the pixels: weight and squared weight times squared residual; weight; its square.
  double squares = 0, weights = 0, slopes = 0;
};

System Linearise(std::span<const CoveragePixel> pixels, double sigma, const Vector& q) {
  System system;
  Model model;
  constexpr double kCauchy2 = kCauchy * kCauchy;
  for (const CoveragePixel& pixel : pixels) {
    Evaluate(q, pixel.at_px, &model);
    const double residual = (pixel.coverage - model.value) / sigma;
    const double squared = residual * residual / kCauchy2;
    const double weight = 1 / (1 + squared);
    system.cost += 0.5 * kCauchy2 * std::log1p(squared);
    system.squares += weight * weight * residual * residual;
    system.weights += weight;
    system.slopes += weight * weight;
    const Vector scaled = model.slope / sigma;
    system.information.selfadjointView<Eigen::Lower>().rankUpdate(scaled, weight);
    system.gradient += weight * residual * scaled;
  }
  return system;
}

void AddPrior(const Vector& prior, const Vector& missing, System* system) {
  system->information.diagonal() += prior;
  system->gradient += prior.cwiseProduct(missing);
  system->cost += 0.5 * missing.dot(prior.cwiseProduct(missing));
}

}  // namespace

bool FitSphereOutline(std::span<const CoveragePixel> pixels, const Eigen::Matrix2d& shape,
                      double noise, bool shaded, SphereOutline* start) {
  if (pixels.size() < kFewest) return false;
  const double sigma = std::hypot(noise, kModelNoise);
  Vector q = Vector::Zero();
  q.head<2>() = start->centre_px;
  q[kRadius] = start->radius_px;
  q[kBrightness] = 1;
  q[kEdge] = kUsualEdgePx2;
  // The ellipse of the second moment: W is the inverse of its root, up to scale.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(shape);
  if (!(eigen.eigenvalues()[0] > 0)) return false;
  const Eigen::Matrix2d root = eigen.operatorInverseSqrt();
  const double half = 0.5 * root.trace();
  q[kStretch] = 0.5 * (root(0, 0) - root(1, 1)) / half;
  q[kShear] = root(0, 1) / half;
  const Vector expected = q;
  Vector prior = Vector::Zero();  // information
  const auto expect = [&](Parameter parameter, double its_sigma) {
    prior[parameter] = 1 / (its_sigma * its_sigma);
  };
  for (const Parameter p : {kStretch, kShear}) expect(p, kShapeSigma);
  expect(kEdge, kEdgeSigma);
  for (const Parameter p : {kEdgeCos, kEdgeSin}) expect(p, kEdgeShapeSigma);
  for (const Parameter p : {kSlopeX, kSlopeY}) expect(p, shaded ? kSlopeSigma : kNoSlopeSigma);
  for (const Parameter p : {kBendAlong, kBendDiagonal, kBendRound}) expect(p, kBendSigma);
  System system = Linearise(pixels, sigma, q);
  AddPrior(prior, expected - q, &system);
  double damping = 1e-3;
  bool settled = false;
  for (int round = 0; round < kMaxRounds && !settled; ++round) {
    Matrix damped = system.information.selfadjointView<Eigen::Lower>();
    damped.diagonal() *= 1 + damping;
    const Vector step = damped.ldlt().solve(system.gradient);
    if (!step.allFinite()) return false;
    Vector next = q + step;
    next[kRadius] = std::clamp(next[kRadius], 0.5 * start->radius_px, 1.6 * start->radius_px);
    next[kEdge] = std::clamp(next[kEdge], 0.08, 0.25 * start->radius_px * start->radius_px + 2);
    System there = Linearise(pixels, sigma, next);
    AddPrior(prior, expected - next, &there);
    const double gained = system.cost - there.cost;
    if (gained < -1e-9) {
      damping *= 8;
      // Where no step gains anything it has arrived.
      settled = damping > 1e6;
      continue;
    }
    damping = std::max(1e-6, 0.2 * damping);
    settled = (next - q).head<2>().norm() < kSettledPx && gained < kSettledCost;
    q = next;
    system = std::move(there);
  }
  if (!settled) return false;
  if (!((q.head<2>() - start->centre_px).norm() < 0.45 * start->radius_px + 0.3)) return false;
  const double free = std::max(1.0, system.weights - static_cast<double>(kCount));
  start->residual = std::sqrt(system.squares / free) * sigma;
  if (!(start->residual < kMostResidual)) return false;
  const Matrix full = system.information.selfadjointView<Eigen::Lower>();
  const Matrix covariance = full.inverse();
  const double factor =
      std::max(1.0, system.squares * system.weights / (free * std::max(1e-9, system.slopes)));
  start->covariance_px2 = factor * covariance.topLeftCorner<2, 2>();
  start->slope_chi_squared = q.segment<2>(kSlopeX).dot(
      (factor * covariance.block<2, 2>(kSlopeX, kSlopeX)).ldlt().solve(q.segment<2>(kSlopeX)));
  start->stretch = -q.segment<2>(kStretch);
  start->edge_px = std::sqrt(q[kEdge]);
  start->brightness = q[kBrightness];
  start->centre_px = q.head<2>();
  start->radius_px =
      q[kRadius] / std::sqrt(std::max(0.1, 1 - q[kStretch] * q[kStretch] - q[kShear] * q[kShear]));
  return start->covariance_px2.allFinite();
}

}  // namespace rigcal::agent
