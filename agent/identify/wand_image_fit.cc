// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_image_fit.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/container/inlined_vector.h"
#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

constexpr int kTilts = 21;  // odd, so that one of them is 0
constexpr int kRefinements = 12;
// Common error of all radii by blur and threshold: mean and one sigma.
constexpr double kRadiusBiasPx = 0.1, kRadiusBiasSigmaPx = 0.8;

class TiltSearch {
 public:
  TiltSearch(absl::Span<const MarkerSight> sights, absl::Span<const double> shares, double length_m,
             const WandImageFitOptions& options)
      : sights_(sights), shares_(shares), length_m_(length_m), options_(options) {
    chord_ = sights.back().ray - sights.front().ray;
    width_ = chord_.norm();
    along_ = chord_ / width_;
    normal_ = sights.front().ray.cross(sights.back().ray).normalized();
    first_along_ = sights.front().ray.dot(along_);
    last_along_ = sights.back().ray.dot(along_);
    distances_m_.resize(sights.size());
    for (size_t k = 0; k < sights.size(); ++k) {
      const MarkerSight& sight = sights[k];
      // Errors of the ends move the line with which the others are compared.
      variance_px2_.push_back(Squared(sight.sigma_px) +
                              Squared((1 - shares[k]) * sights.front().sigma_px) +
                              Squared(shares[k] * sights.back().sigma_px));
      across_.push_back(Squared(sight.ray.dot(normal_)));
      ray_along_.push_back(sight.ray.dot(along_));
      radius_weight_.push_back(1 / Squared(sight.radius_sigma_px));
      radius_weights_ += radius_weight_.back();
    }
  }

  bool usable() const { return width_ > 1e-9 && width_ < 1.9; }

  // Returns the cost if the line through the ends has an angle of tangent `slope` to the plane
  // across the line of sight. Of points between the rays only the distance and the part along the
  // chord are needed: with unit rays a, b at distance w, |p a + q b|^2 = (p + q)^2 - p q w^2.
  double Cost(double slope, WandImageFit* fit) {
    const double half = std::clamp(0.5 * width_ * slope, -0.95, 0.95);
    const double near = 1 - half, far = 1 + half;  // distances of the ends over their mean
    const double squared_width = width_ * width_;
    const double mean_m = length_m_ / std::sqrt(Squared(far - near) + far * near * squared_width);
    if (fit != nullptr) {
      *fit = {0, mean_m * near * sights_.front().ray, mean_m * far * sights_.back().ray, 0};
    }
    if (!(mean_m * std::min(near, far) >= options_.min_distance_m) ||
        !(mean_m * std::max(near, far) <= options_.max_distance_m)) {
      return std::numeric_limits<double>::infinity();
    }
    const size_t end = sights_.size() - 1;
    distances_m_[0] = mean_m * near;
    distances_m_[end] = mean_m * far;
    double cost = 0;
    for (size_t k = 1; k < end; ++k) {
      const MarkerSight& sight = sights_[k];
      const double p = (1 - shares_[k]) * near, q = shares_[k] * far;
      const double length = std::sqrt(Squared(p + q) - p * q * squared_width);
      distances_m_[k] = mean_m * length;
      const double play_px = options_.span_sigma_m / distances_m_[k] * sight.scale_px;
      const double beside = ray_along_[k] - (p * first_along_ + q * last_along_) / length;
      cost += (Squared(beside) + across_[k]) * Squared(sight.scale_px) /
              (variance_px2_[k] + Squared(play_px));
    }
    return cost + RadiusCost();
  }

 private:
  double RadiusCost() const {
    double factor = 0.5 * options_.diameter_m;
    if (!(factor > 0)) {
      for (size_t k = 0; k < sights_.size(); ++k) {
        factor += radius_weight_[k] * sights_[k].radius_px * distances_m_[k] / sights_[k].scale_px;
      }
      factor /= radius_weights_;
    }
    double sum = 0, squares = 0;
    for (size_t k = 0; k < sights_.size(); ++k) {
      const double expected = factor * sights_[k].scale_px / distances_m_[k];
      const double residual = sights_[k].radius_px - expected;
      sum += radius_weight_[k] * residual;
      squares += radius_weight_[k] * residual * residual;
    }
    const double mean = sum / radius_weights_;
    double cost = squares - radius_weights_ * mean * mean;
    if (options_.diameter_m > 0) {
      cost += Squared(mean - kRadiusBiasPx) / (Squared(kRadiusBiasSigmaPx) + 1 / radius_weights_);
    }
    return cost;
  }

  absl::Span<const MarkerSight> sights_;
  absl::Span<const double> shares_;
  double length_m_;
  const WandImageFitOptions& options_;
  Eigen::Vector3d chord_, along_, normal_;
  double width_ = 0, first_along_ = 0, last_along_ = 0;
  // By marker: variance of its place, squared distance of its ray from the plane of the end rays,
  // part of it along the chord, weight of its radius, distance.
  absl::InlinedVector<double, 4> variance_px2_, across_, ray_along_, radius_weight_, distances_m_;
  double radius_weights_ = 0;
};

}  // namespace

bool FitWand(absl::Span<const MarkerSight> sights, absl::Span<const double> shares, double length_m,
             const WandImageFitOptions& options, WandImageFit* fit) {
  TiltSearch search(sights, shares, length_m, options);
  if (!search.usable()) return false;
  double best = std::numeric_limits<double>::infinity(), best_tilt = 0, best_slope = 0;
  const auto attempt = [&](double tilt, double slope) {
    const double cost = search.Cost(slope, nullptr);
    if (cost < best) best = cost, best_tilt = tilt, best_slope = slope;
  };
  const double step = 2 * options.max_tilt_rad / (kTilts - 1);
  // Tangent of the sum of two angles, from their tangents.
  const auto added = [](double a, double b) { return (a + b) / (1 - a * b); };
  attempt(0, 0);
  const double step_slope = std::tan(step);
  double slope = 0;
  for (int i = 1; i <= kTilts / 2; ++i) {
    slope = added(slope, step_slope);
    attempt(i * step, slope);
    attempt(-i * step, -slope);
  }
  if (!std::isfinite(best)) return false;
  double width = 0.5 * step;
  for (int i = 0; i < kRefinements; ++i, width *= 0.6) {
    // Tangent of a small angle; the terms that are left out are below 1e-12.
    const double squared = width * width;
    const double by =
        width * (1 + squared * (1.0 / 3 + squared * (2.0 / 15 + squared * (17.0 / 315))));
    const double low = best_tilt - width, high = best_tilt + width;
    const double low_slope = added(best_slope, -by), high_slope = added(best_slope, by);
    if (std::abs(low) <= options.max_tilt_rad) attempt(low, low_slope);
    if (std::abs(high) <= options.max_tilt_rad) attempt(high, high_slope);
  }
  search.Cost(std::tan(best_tilt), fit);
  fit->cost = best;
  fit->tilt_rad = best_tilt;
  return true;
}

}  // namespace rigcal::agent
