// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_image_fit.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

constexpr int kTilts = 21;  // odd: one of them is none
constexpr int kRefinements = 12;
// Common error of all radii by blur and threshold: mean and sigma.
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
    distances_m_.resize(sights.size());
    for (size_t k = 0; k < sights.size(); ++k) {
      const MarkerSight& sight = sights[k];
      // The ends' own errors move the line that the others are compared with.
      variance_px2_.push_back(Squared(sight.sigma_px) +
                              Squared((1 - shares[k]) * sights.front().sigma_px) +
                              Squared(shares[k] * sights.back().sigma_px));
      across_.push_back(Squared(sight.ray.dot(normal_)));
      radius_weight_.push_back(1 / Squared(sight.radius_sigma_px));
      radius_weights_ += radius_weight_.back();
    }
  }

  bool usable() const { return width_ > 1e-9 && width_ < 1.9; }

  // The ends lie at an angle of tangent `slope` to the plane across the line of sight.
  double Cost(double slope, WandImageFit* fit) {
    const double half = std::clamp(0.5 * width_ * slope, -0.95, 0.95);
    const double near = 1 - half, far = 1 + half;  // distances of the ends, of their mean
    const Eigen::Vector3d line = far * sights_.back().ray - near * sights_.front().ray;
    const double mean_m = length_m_ / line.norm();
    const Eigen::Vector3d first = mean_m * near * sights_.front().ray;
    const Eigen::Vector3d last = mean_m * far * sights_.back().ray;
    if (fit != nullptr) *fit = {0, first, last, 0};
    if (!(mean_m * std::min(near, far) >= options_.min_distance_m) ||
        !(mean_m * std::max(near, far) <= options_.max_distance_m)) {
      return std::numeric_limits<double>::infinity();
    }
    const Eigen::Vector3d span = last - first;
    const size_t end = sights_.size() - 1;
    distances_m_[0] = mean_m * near;
    distances_m_[end] = mean_m * far;
    double cost = 0;
    for (size_t k = 1; k < end; ++k) {
      const MarkerSight& sight = sights_[k];
      const Eigen::Vector3d x = first + shares_[k] * span;
      distances_m_[k] = x.norm();
      const double play_px = options_.span_sigma_m / distances_m_[k] * sight.scale_px;
      const double beside = sight.ray.dot(along_) - x.dot(along_) / distances_m_[k];
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
  double width_ = 0;
  // By marker: of its place, squared distance from the line, of its radius.
  absl::InlinedVector<double, 4> variance_px2_, across_, radius_weight_, distances_m_;
  double radius_weights_ = 0;
};

}  // namespace

bool FitWand(absl::Span<const MarkerSight> sights, absl::Span<const double> shares, double length_m,
             const WandImageFitOptions& options, WandImageFit* fit) {
  TiltSearch search(sights, shares, length_m, options);
  if (!search.usable()) return false;
  double best = std::numeric_limits<double>::infinity(), best_tilt = 0;
  const auto attempt = [&](double tilt, double slope) {
    const double cost = search.Cost(slope, nullptr);
    if (cost < best) best = cost, best_tilt = tilt;
  };
  const double step = 2 * options.max_tilt_rad / (kTilts - 1);
  attempt(0, 0);
  for (int i = 1; i <= kTilts / 2; ++i) {
    const double tilt = i * step, slope = std::tan(tilt);
    attempt(tilt, slope);
    attempt(-tilt, -slope);
  }
  if (!std::isfinite(best)) return false;
  double width = 0.5 * step;
  for (int i = 0; i < kRefinements; ++i, width *= 0.6) {
    for (const double tilt : {best_tilt - width, best_tilt + width}) {
      if (std::abs(tilt) <= options.max_tilt_rad) attempt(tilt, std::tan(tilt));
    }
  }
  search.Cost(std::tan(best_tilt), fit);
  fit->cost = best;
  fit->tilt_rad = best_tilt;
  return true;
}

}  // namespace rigcal::agent
