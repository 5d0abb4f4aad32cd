// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/overlapping_markers.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigcal::agent {
namespace {

constexpr double kOverlapRingPx = 2.1, kOverlapBlurPx = 1;  // of what is around a disc

double SquaredRadius(const Blob& disc) {
  return 2 * disc.second_moment_px2.trace();  // a quarter of it along each axis
}

}  // namespace

double OverlapShare(const Blob& disc, const Blob& other) {
  const double ring_px = std::sqrt(disc.area_px / std::numbers::pi) + kOverlapRingPx;
  const double other_px = std::sqrt(other.area_px / std::numbers::pi) + kOverlapBlurPx;
  const double apart_px = (disc.centre_px - other.centre_px).norm();
  if (!(apart_px < ring_px + other_px) || !(apart_px > 0)) return 0;
  const double cosine =
      (ring_px * ring_px + apart_px * apart_px - other_px * other_px) / (2 * ring_px * apart_px);
  return std::acos(std::clamp(cosine, -1.0, 1.0)) / std::numbers::pi;
}

bool IsBeyond(const Blob& disc, const Blob& other) {
  const double radius_px = std::sqrt(disc.area_px / std::numbers::pi);
  const double other_px = std::sqrt(other.area_px / std::numbers::pi) + kOverlapBlurPx;
  return (disc.centre_px - other.centre_px).norm() <
         radius_px + MarkerCentre::BeyondPx(radius_px) + MarkerCentre::kBeyondWidthPx + other_px;
}

double HiddenShare(const VerifiedWand& wand, size_t marker) {
  if (wand.px_per_m.size() != wand.centres.size()) return 0;
  const auto radius_of = [&](size_t k) {
    return wand.diameter_m > 0 ? 0.5 * wand.diameter_m * wand.px_per_m[k]
                               : wand.centres[k].radius_px;
  };
  const double own = radius_of(marker);
  double hidden = 0;
  for (size_t k = 0; k < wand.centres.size(); ++k) {
    if (k == marker || wand.px_per_m[k] <= wand.px_per_m[marker]) continue;
    const double other = radius_of(k);
    const double apart = (wand.centres[k].centre_px - wand.centres[marker].centre_px).norm();
    if (!(apart < own + other)) continue;
    // Half the lens about the line between the centres: a sector less a triangle, of both.
    const auto segment = [apart](double r, double of_other) {
      const double cosine = (apart * apart + r * r - of_other * of_other) / (2 * apart * r);
      const double angle = std::acos(std::clamp(cosine, -1.0, 1.0));
      return r * r * (angle - std::sin(angle) * std::cos(angle));
    };
    hidden += (segment(own, other) + segment(other, own)) / (std::numbers::pi * own * own);
  }
  return hidden;
}

void LeaveOutBeyond(const Blob& own, const Blob& other, OutlinePixels* pixels) {
  const double difference = SquaredRadius(own) - SquaredRadius(other);
  for (size_t i = 0; i < pixels->x.size(); ++i) {
    const Eigen::Vector2d at(static_cast<double>(pixels->x[i]), static_cast<double>(pixels->y[i]));
    const double nearer = (at - other.centre_px).squaredNorm() - (at - own.centre_px).squaredNorm();
    if (nearer + difference < 0) pixels->precision[i] = 0;
  }
}

}  // namespace rigcal::agent
