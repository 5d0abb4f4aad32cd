// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/sphere_outline_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

// Priors of the parameters, one sigma each; the place has none.
constexpr double kShapeSigma = 0.04, kEdgeSigma = 1.5, kEdgeShapeSigma = 0.5;
constexpr double kBendSigma = 0.3, kWhiteSigma = 1.5;
constexpr double kMostOwnSlope = 0.2;          // limit of the own slopes' sigma beside white light
constexpr double kSky = 0.2, kSkySigma = 0.2;  // mean and sigma of k
// What a saturated background takes off the outline: mean and sigma of the prior, and the limit.
constexpr double kOutshonePx = 0.5, kOutshoneSigmaPx = 0.7, kMostOutshonePx = 3;
constexpr double kUsualEdgePx2 = 0.5;  // start value of s: a pixel's own width and a little blur
constexpr float kCauchy = 2.4f;        // width of the robust loss, sigmas
// A second attempt from further away is made if a pixel costs more than this in the mean. It begins
// with the robust loss widened by these factors, one after the other.
constexpr double kFarCost = 1.2;
constexpr float kWiderLosses[] = {6, 3, 1.5f};
constexpr size_t kFewest = kOutlineCount + 8;  // pixels that a fit needs
constexpr int kMaxRounds = 20;
constexpr double kLeastRejected = 0.03;                   // damping after a step that was too long
constexpr double kSettledPx = 0.004, kSettledCost = 0.5;  // a smaller step ends the fit
constexpr double kNearlyPx = 0.03, kNearlyCost = 2;       // enough when the rounds are used up
constexpr double kSameCost = 1e-3;                        // rounding in single precision
constexpr size_t kSectors = kOutlineSectors;
// An edge is off the outline if it is further away than kOffPx plus kOffShare radii and, added in
// squares, kOffNoises sigmas of its noise; these count as kMostOffNoise times the former at most.
constexpr double kOffPx = 0.3, kOffShare = 0.03;
constexpr double kOffNoises = 2, kMostOffNoise = 1.2;
constexpr double kLeastFollows = 0.6;
constexpr double kOutlineFreedom = 5;  // sectors that place, radius and shape take

constexpr OutlineParameter kPlaceAndSize[] = {kOutlineX, kOutlineY, kOutlineRadius,
                                              kOutlineBrightness};

using OutlineVector = Eigen::Matrix<double, kOutlineCount, 1>;
using OutlineMatrix = Eigen::Matrix<double, kOutlineCount, kOutlineCount>;

// Solves for the first `kUsed` parameters; the others are not in the model and stay as they are.
template <int kUsed>
OutlineVector SolvedStep(const OutlineMatrix& information, const OutlineVector& gradient) {
  OutlineVector step = OutlineVector::Zero();
  step.head<kUsed>() =
      information.topLeftCorner<kUsed, kUsed>().ldlt().solve(gradient.head<kUsed>());
  return step;
}

// Solves for the place, the size and the brightness; the others stay as they are.
OutlineVector PlaceStep(const OutlineMatrix& information, const OutlineVector& gradient) {
  Eigen::Matrix4d place;
  Eigen::Vector4d slope;
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k <= i; ++k) {
      const auto [low, high] = std::minmax(kPlaceAndSize[i], kPlaceAndSize[k]);
      place(i, k) = place(k, i) = information(high, low);
    }
    slope[i] = gradient[kPlaceAndSize[i]];
  }
  const Eigen::Vector4d solved = place.ldlt().solve(slope);
  OutlineVector step = OutlineVector::Zero();
  for (int i = 0; i < 4; ++i) step[kPlaceAndSize[i]] = solved[i];
  return step;
}

template <int kUsed>
OutlineMatrix InverseOf(const OutlineMatrix& information) {
  OutlineMatrix inverse = OutlineMatrix::Zero();
  inverse.topLeftCorner<kUsed, kUsed>() = information.topLeftCorner<kUsed, kUsed>().inverse();
  return inverse;
}

}  // namespace

// Only compares, because the sectors end at multiples of 22.5 degrees.
size_t OutlineSector(double offset_x, double offset_y) {
  // Turns the offset into the first quadrant.
  const bool below = offset_y < 0;
  const double x = below ? -offset_x : offset_x, y = below ? -offset_y : offset_y;
  const bool left = !(x > 0);
  const double u = left ? y : x, v = left ? -x : y;
  constexpr double kFirst = std::numbers::sqrt2 - 1, kThird = std::numbers::sqrt2 + 1;  // tangents
  const int within = (v >= kFirst * u ? 1 : 0) + (v >= u ? 1 : 0) + (v >= kThird * u ? 1 : 0);
  static_assert(kSectors == 16);
  return static_cast<size_t>((below ? 0 : 8) + (left ? 4 : 0) + within);
}

size_t OutlinePart(const OutlinePixels& pixels, size_t pixel, const Eigen::Vector2d& centre_px) {
  if (!pixels.stick_side.empty() && pixels.stick_side[pixel] > 0) {
    return kOutlineSectors + pixels.stick_side[pixel] - 1;
  }
  return OutlineSector(static_cast<double>(pixels.x[pixel]) - centre_px.x(),
                       static_cast<double>(pixels.y[pixel]) - centre_px.y());
}

Eigen::Matrix2d SphereOutline::SecondMoment() const {
  Eigen::Matrix2d w;
  w << 1 + parameters[kOutlineStretch], parameters[kOutlineShear], parameters[kOutlineShear],
      1 - parameters[kOutlineStretch];
  w /= parameters[kOutlineRadius];
  return 0.25 * (w * w).inverse();
}

void SphereOutlineFitter::Weigh(const OutlinePixels& pixels, System* system) {
  const float width = kCauchy * wider_loss_;
  const OutlineWeights sums = rows_.Weigh(pixels, width, &residual_, &weight_);
  system->squares = sums.squares;
  system->weights = sums.weights;
  system->slopes = sums.squared_weights;
  system->cost = 0.5 * static_cast<double>(width * width) * sums.log_spreads;
}

SphereOutlineFitter::System SphereOutlineFitter::Evaluate(const OutlinePixels& pixels,
                                                          const Vector& parameters,
                                                          bool white_light) {
  const Eigen::Matrix<float, kOutlineCount, 1> single = parameters.cast<float>();
  rows_.Model(pixels, single.data(), white_light);
  System system;
  Weigh(pixels, &system);
  return system;
}

void SphereOutlineFitter::SumProducts(System* system) {
  Eigen::Matrix<float, kOutlineCount, kOutlineCount, Eigen::RowMajor> products;
  products.setZero();
  Eigen::Matrix<float, kOutlineCount, 1> gradient = Eigen::Matrix<float, kOutlineCount, 1>::Zero();
  rows_.Sum(weight_, residual_, products.data(), gradient.data());
  system->information = products.cast<double>();
  system->gradient = gradient.cast<double>();
}

void SphereOutlineFitter::ReadEdge(const OutlinePixels& pixels, SphereOutline* outline) const {
  auto& scores = outline->sector_score;
  auto& informations = outline->sector_information;
  scores.fill(0), informations.fill(0);
  double all = 0;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const size_t sector = OutlinePart(pixels, i, outline->centre_px);
    const auto slope = static_cast<double>(rows_.slope(kOutlineRadius, i));
    const auto weight = static_cast<double>(weight_[i]);
    scores[sector] += weight * slope * static_cast<double>(residual_[i]);
    informations[sector] += weight * slope * slope;
    all += weight * slope * slope;
  }
  outline->edge_chi_squared = 0;
  outline->edge_freedom = -kOutlineFreedom;
  outline->on_outline = outline->off_outline = 0;
  const double known_px = kOffPx + kOffShare * outline->radius_px;
  const double noise2 = Squared(kOffNoises);
  for (size_t k = 0; k < kSectors; ++k) {
    // A sector that is blocked tells nothing.
    if (informations[k] < 0.2 * all / kSectors) continue;
    const double off_px = std::sqrt(
        Squared(known_px) + std::min(noise2 / informations[k], Squared(kMostOffNoise * known_px)));
    (std::abs(scores[k]) < off_px * informations[k] ? outline->on_outline : outline->off_outline) +=
        1.0 / kSectors;
    outline->edge_chi_squared += scores[k] * scores[k] / informations[k];
    outline->edge_freedom += 1;
  }
  for (double& information : informations) information *= outline->follows;
}

void SphereOutlineFitter::MeasureEdge(const OutlinePixels& pixels, SphereOutline* outline) {
  const Eigen::Matrix<float, kOutlineCount, 1> single = outline->parameters.cast<float>();
  rows_.ModelEdge(pixels, single.data(), outline->white);
  System system;
  Weigh(pixels, &system);
  ReadEdge(pixels, outline);
}

bool SphereOutlineFitter::Fit(const OutlinePixels& pixels, const Eigen::Matrix2d& shape,
                              const SphereShading& shading, SphereOutline* start,
                              const OutlineExpectation& others) {
  if (pixels.size() < kFewest) return false;
  Vector q = Vector::Zero();
  q.head<2>() = start->centre_px;
  q[kOutlineRadius] = start->radius_px;
  q[kOutlineBrightness] = 1;
  q[kOutlineEdge] = kUsualEdgePx2;
  // Starts from the ellipse of the second moment: W is the inverse of its root, up to scale.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(shape);
  if (!(eigen.eigenvalues()[0] > 0)) return false;
  const Eigen::Matrix2d root = eigen.operatorInverseSqrt();
  const double half = 0.5 * root.trace();
  q[kOutlineStretch] = 0.5 * (root(0, 0) - root(1, 1)) / half;
  q[kOutlineShear] = root(0, 1) / half;
  Vector expected = q;
  if (start->parameters[kOutlineRadius] > 0) q = start->parameters;
  Vector prior = Vector::Zero();  // information
  const auto expect = [&](OutlineParameter parameter, double its_sigma) {
    prior[parameter] = 1 / (its_sigma * its_sigma);
  };
  for (const auto p : {kOutlineStretch, kOutlineShear}) expect(p, kShapeSigma);
  expect(kOutlineEdge, kEdgeSigma);
  for (const auto p : {kOutlineEdgeCos, kOutlineEdgeSin}) expect(p, kEdgeShapeSigma);
  for (const auto p : {kOutlineSlopeX, kOutlineSlopeY}) {
    expect(p, shading.white ? kWhiteSigma : shading.slope_sigma);
  }
  for (const auto p : {kOutlineBendAlong, kOutlineBendDiagonal, kOutlineBendRound}) {
    expect(p, kBendSigma);
  }
  for (const auto p : {kOutlineOwnX, kOutlineOwnY}) {
    expect(p, std::min(shading.slope_sigma, kMostOwnSlope));
  }
  expect(kOutlineSky, kSkySigma);
  if (shading.white) {
    expected[kOutlineSky] = kSky;
    if (!start->white) q[kOutlineSky] = kSky;
    expect(kOutlineBendAlong, kWhiteSigma);
    // The half that is lit changes by twice the slope of the whole.
    const double lit = q.segment<2>(kOutlineSlopeX).norm();
    if (!start->white && lit > 0) q.segment<2>(kOutlineSlopeX) *= 2;
    if (!start->white) q[kOutlineBendAlong] = q[kOutlineBendDiagonal] = 0;
    if (!(lit > 0)) return false;
  }
  expect(kOutlineOutshone, kOutshoneSigmaPx);
  const bool is_outshone = pixels.IsOutshone();
  if (is_outshone) {
    expected[kOutlineOutshone] = kOutshonePx;
    if (!(start->parameters[kOutlineRadius] > 0)) q[kOutlineOutshone] = kOutshonePx;
  }
  if (others.radius_px > 0) {
    expected[kOutlineRadius] = others.radius_px;
    expect(kOutlineRadius, others.radius_sigma_px);
  }
  if (others.stretch_sigma > 0) {
    expected.segment<2>(kOutlineStretch) = -others.stretch;
    for (const auto p : {kOutlineStretch, kOutlineShear}) expect(p, others.stretch_sigma);
  }
  if (others.edge_px2 > 0) {
    expected[kOutlineEdge] = others.edge_px2;
    expect(kOutlineEdge, others.edge_sigma_px2);
  }
  const auto evaluate = [&](const Vector& at) {
    System system = Evaluate(pixels, at, shading.white);
    const Vector missing = expected - at;
    system.cost += 0.5 * missing.dot(prior.cwiseProduct(missing));
    return system;
  };
  // Completes the result of the last evaluate(), which was at the same place.
  const auto sum = [&](const Vector& at, System* system) {
    SumProducts(system);
    system->information.diagonal() += prior;
    system->gradient += prior.cwiseProduct(expected - at);
  };
  const auto linearise = [&](const Vector& at) {
    System system = evaluate(at);
    sum(at, &system);
    return system;
  };
  const auto limit = [start](Vector* at) {
    double& radius = (*at)[kOutlineRadius];
    double& edge = (*at)[kOutlineEdge];
    radius = std::clamp(radius, 0.5 * start->radius_px, 1.6 * start->radius_px);
    double& outshone = (*at)[kOutlineOutshone];
    outshone = std::clamp(outshone, 0.0, kMostOutshonePx);
    edge = std::clamp(edge, 0.08, 0.25 * start->radius_px * start->radius_px + 2);
  };
  const bool has_all = shading.white || is_outshone;
  const auto step_of = [has_all](const Matrix& information, const Vector& gradient) {
    return has_all ? SolvedStep<kOutlineCount>(information, gradient)
                   : SolvedStep<kOutlineOwnX>(information, gradient);
  };
  const Vector begin = q;
  System system = linearise(q);
  const int attempts = system.cost > kFarCost * static_cast<double>(pixels.size()) ? 2 : 1;
  bool settled = false, nearly = false, current = true;  // rows_ are those of q
  for (int attempt = 0; attempt < attempts && !settled && !nearly; ++attempt) {
    if (attempt > 0) {
      // A stick that hides a part of a sphere moves its centroid so far that most of the edge looks
      // like outliers. Graduated non-convexity (Blake and Zisserman, Visual Reconstruction, 1987):
      // the loss goes from wide to narrow, while shape and light stay as expected.
      q = begin;
      for (const float wider : kWiderLosses) {
        wider_loss_ = wider;
        system = linearise(q);
        const Vector step = PlaceStep(system.information, system.gradient);
        if (!step.allFinite()) break;
        q += step;
        limit(&q);
      }
      wider_loss_ = 1;
      system = linearise(q);
      current = true;
    }
    double damping = 1e-3;
    for (int round = 0; round < kMaxRounds && !settled; ++round) {
      Matrix damped = system.information.selfadjointView<Eigen::Lower>();
      damped.diagonal() *= 1 + damping;
      const Vector step = step_of(damped, system.gradient);
      if (!step.allFinite()) return false;
      Vector next = q + step;
      limit(&next);
      const double moved_px = (next - q).head<2>().norm();
      // The gain of the step if the cost were quadratic.
      const double expected_gain = 0.5 * step.dot(system.gradient);
      if (moved_px < kSettledPx && expected_gain < kSettledCost) {
        settled = true;
        q = next;
        break;
      }
      System there = evaluate(next);
      const double gained = system.cost - there.cost;
      if (gained < -kSameCost) {
        damping = std::max(kLeastRejected, 8 * damping);
        current = false;
        continue;
      }
      sum(next, &there);
      damping = std::max(1e-6, 0.2 * damping);
      settled = moved_px < kSettledPx && gained < kSettledCost;
      nearly = moved_px < kNearlyPx && gained < kNearlyCost;
      q = next;
      current = true;
      system = std::move(there);
    }
  }
  if (!settled && !nearly) return false;
  if (!((q.head<2>() - start->centre_px).norm() < 0.45 * start->radius_px + 0.3)) return false;
  if (!current) system = linearise(q);
  const double free = std::max(1.0, system.weights - static_cast<double>(kOutlineCount));
  start->residual = std::sqrt(system.squares / free);
  const Matrix full = system.information.selfadjointView<Eigen::Lower>();
  const Matrix covariance =
      has_all ? InverseOf<kOutlineCount>(full) : InverseOf<kOutlineOwnX>(full);
  // The weight of an outlier falls, so a shift of all pixels changes the sum of w r by the slope of
  // w r, 2 w^2 - w, not by w: Huber, Robust Statistics (1981), 7.6.
  start->follows = std::clamp((2 * system.slopes - system.weights) / std::max(1.0, system.weights),
                              kLeastFollows, 1.0);
  start->pixel_noise = start->residual * start->residual / start->follows;
  start->covariance_px2 = covariance.topLeftCorner<2, 2>();
  start->slope_chi_squared = q.segment<2>(kOutlineSlopeX)
                                 .dot(covariance.block<2, 2>(kOutlineSlopeX, kOutlineSlopeX)
                                          .ldlt()
                                          .solve(q.segment<2>(kOutlineSlopeX)));
  const double brightness = std::max(0.1, q[kOutlineBrightness]);
  start->slope = q.segment<2>(kOutlineSlopeX) / brightness;
  const int own = shading.white ? kOutlineOwnX : kOutlineSlopeX;
  start->own_slope = q.segment<2>(own) / brightness;
  start->own_slope_covariance = covariance.block<2, 2>(own, own) / (brightness * brightness);
  start->slope_covariance =
      covariance.block<2, 2>(kOutlineSlopeX, kOutlineSlopeX) / (brightness * brightness);
  start->cost = system.cost;
  start->white = shading.white;
  start->parameters = q;
  start->stretch = -q.segment<2>(kOutlineStretch);
  start->edge_px = std::sqrt(q[kOutlineEdge]);
  start->brightness = q[kOutlineBrightness];
  start->centre_px = q.head<2>();
  start->radius_px = q[kOutlineRadius] / std::sqrt(std::max(0.1, 1 - start->stretch.squaredNorm()));
  ReadEdge(pixels, start);
  return start->covariance_px2.allFinite();
}

}  // namespace rigcal::agent
