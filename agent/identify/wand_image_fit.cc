// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_image_fit.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace rigcal::agent {
namespace {

constexpr int kTilts = 21;  // odd: one of them is none
constexpr int kRefinements = 12;
// Common error of all radii by blur and threshold: mean and sigma.
constexpr double kRadiusBiasPx = 0.1, kRadiusBiasSigmaPx = 0.8;

double Square(double x) { return x * x; }

class TiltSearch {
 public:
  TiltSearch(absl::Span<const MarkerSight> sights, absl::Span<const double> shares, double length_m,
             const WandImageFitOptions& options)
      : sights_(sights), shares_(shares), length_m_(length_m), options_(options) {
    chord_ = sights.back().ray - sights.front().ray;
    width_ = chord_.norm();
    along_ = chord_ / width_;
    normal_ = sights.front().ray.cross(sights.back().ray).normalized();
  }

  bool usable() const { return width_ > 1e-9 && width_ < 1.9; }

  // The ends lie at an angle `tilt` to the plane across the line of sight.
  double Cost(double tilt, WandImageFit* fit) const {
    const double half = std::clamp(0.5 * width_ * std::tan(tilt), -0.95, 0.95);
    const double near = 1 - half, far = 1 + half;  // distances of the ends, of their mean
    const Eigen::Vector3d line = far * sights_.back().ray - near * sights_.front().ray;
    const double mean_m = length_m_ / line.norm();
    const Eigen::Vector3d first = mean_m * near * sights_.front().ray;
    const Eigen::Vector3d last = mean_m * far * sights_.back().ray;
    if (fit != nullptr) *fit = {0, first, last, tilt};
    if (!(mean_m * std::min(near, far) >= options_.min_distance_m) ||
        !(mean_m * std::max(near, far) <= options_.max_distance_m)) {
      return std::numeric_limits<double>::infinity();
    }
    const Eigen::Vector3d span = last - first;
    double cost = 0, across = 0;
    absl::InlinedVector<double, 4> distances_m(sights_.size());
    for (size_t k = 0; k < sights_.size(); ++k) {
      const MarkerSight& sight = sights_[k];
      const Eigen::Vector3d x = first + shares_[k] * span;
      distances_m[k] = x.norm();
      if (k == 0 || k + 1 == sights_.size()) continue;
      const Eigen::Vector3d ray = x / distances_m[k];
      const double play_px = options_.span_sigma_m / distances_m[k] * sight.scale_px;
      // The ends' own errors move the line that the others are compared with.
      const double sigma_px =
          std::hypot(sight.sigma_px, std::hypot((1 - shares_[k]) * sights_.front().sigma_px,
                                                shares_[k] * sights_.back().sigma_px));
      const double scale2 = Square(sight.scale_px) / (Square(sigma_px) + Square(play_px));
      cost += Square((sight.ray - ray).dot(along_)) * scale2;
      across += Square(sight.ray.dot(normal_)) * scale2;
    }
    return cost + across + RadiusCost(distances_m);
  }

 private:
  double RadiusCost(const absl::InlinedVector<double, 4>& distances_m) const {
    double factor = 0.5 * options_.diameter_m;
    if (!(factor > 0)) {
      double weights = 0;
      for (size_t k = 0; k < sights_.size(); ++k) {
        const double w = 1 / Square(sights_[k].radius_sigma_px);
        factor += w * sights_[k].radius_px * distances_m[k] / sights_[k].scale_px;
        weights += w;
      }
      factor /= weights;
    }
    double sum = 0, weights = 0, squares = 0;
    for (size_t k = 0; k < sights_.size(); ++k) {
      const double expected = factor * sights_[k].scale_px / distances_m[k];
      const double residual = sights_[k].radius_px - expected;
      const double w = 1 / Square(sights_[k].radius_sigma_px);
      sum += w * residual;
      squares += w * residual * residual;
      weights += w;
    }
    const double mean = sum / weights;
    double cost = squares - weights * mean * mean;
    if (options_.diameter_m > 0) {
      cost += Square(mean - kRadiusBiasPx) / (Square(kRadiusBiasSigmaPx) + 1 / weights);
    }
    return cost;
  }

  absl::Span<const MarkerSight> sights_;
  absl::Span<const double> shares_;
  double length_m_;
  const WandImageFitOptions& options_;
  Eigen::Vector3d chord_, along_, normal_;
  double width_ = 0;
};

}  // namespace

bool FitWand(absl::Span<const MarkerSight> sights, absl::Span<const double> shares, double length_m,
             const WandImageFitOptions& options, WandImageFit* fit) {
  const TiltSearch search(sights, shares, length_m, options);
  if (!search.usable()) return false;
  double best = std::numeric_limits<double>::infinity(), best_tilt = 0;
  const auto attempt = [&](double tilt) {
    const double cost = search.Cost(tilt, nullptr);
    if (cost < best) best = cost, best_tilt = tilt;
  };
  const double step = 2 * options.max_tilt_rad / (kTilts - 1);
  for (int i = 0; i < kTilts; ++i) {
    attempt(-options.max_tilt_rad + i * step);
  }
  if (!std::isfinite(best)) return false;
  double width = 0.5 * step;
  for (int i = 0; i < kRefinements; ++i, width *= 0.6) {
    for (const double tilt : {best_tilt - width, best_tilt + width}) {
      if (std::abs(tilt) <= options.max_tilt_rad) attempt(tilt);
    }
  }
  search.Cost(best_tilt, fit);
  fit->cost = best;
  return true;
}

}  // namespace rigcal::agent
