// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/third_marker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "agent/identify/ring_background.h"
#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

constexpr double kWorkOfSample = 0.08;                  // against one that is measured
constexpr double kMiddle = 0.5;                         // of the radius: samples of the middle
constexpr double kOutsideRadii = 1.15, kOutsidePx = 2;  // samples around
constexpr size_t kDirections = 16;
constexpr int kMostLikeMiddle = 5;   // directions
constexpr float kLeastStepGrey = 7;  // of a sample's difference from the middle
constexpr double kMiddleBrightness = 0.25,
                 kMiddleColour = 0.12;  // one sigma: of the logarithm; in rad
constexpr double kMostCost = 9;

// Around a place, evenly.
const std::array<Eigen::Vector2d, kDirections>& Directions() {
  static const auto directions = [] {
    std::array<Eigen::Vector2d, kDirections> made;
    for (size_t k = 0; k < kDirections; ++k) {
      const double angle = static_cast<double>(k) * 2 * std::numbers::pi / kDirections;
      made[k] = {std::cos(angle), std::sin(angle)};
    }
    return made;
  }();
  return directions;
}

Eigen::Vector3f MeanOf4(const ImageView& image, const Eigen::Vector2d& at_px) {
  const int left = static_cast<int>(std::floor(at_px.x()));
  const int top = static_cast<int>(std::floor(at_px.y()));
  return 0.25f * (GreyAt(image, left, top) + GreyAt(image, left + 1, top) +
                  GreyAt(image, left, top + 1) + GreyAt(image, left + 1, top + 1));
}

}  // namespace

std::optional<double> ThirdMarkerCost(const ImageView& image, const Eigen::Vector2d& centre_px,
                                      double radius_px, const Eigen::Vector3f& core, double* work) {
  const double reach_px = kOutsideRadii * radius_px + kOutsidePx;
  if (!(centre_px.x() > reach_px && centre_px.y() > reach_px &&
        centre_px.x() + reach_px + 2 < image.width &&
        centre_px.y() + reach_px + 2 < image.height)) {
    return std::nullopt;
  }
  Eigen::Vector3f middle = MeanOf4(image, centre_px);
  for (size_t k = 0; k < kDirections; k += 2) {
    middle += MeanOf4(image, centre_px + kMiddle * radius_px * Directions()[k]);
  }
  middle /= 9;
  *work -= kWorkOfSample * 36;
  const float brightness = std::max(1.0f, middle.norm()), expected = std::max(1.0f, core.norm());
  const double cost =
      Squared(static_cast<double>(std::log(brightness / expected)) / kMiddleBrightness) +
      static_cast<double>((middle / brightness - core / expected).squaredNorm()) /
          Squared(kMiddleColour);
  if (cost > kMostCost) return std::nullopt;
  *work -= kWorkOfSample * 4 * kDirections;
  int alike = 0;
  for (const Eigen::Vector2d& direction : Directions()) {
    const Eigen::Vector3f there = MeanOf4(image, centre_px + reach_px * direction);
    alike += (there - middle).squaredNorm() < kLeastStepGrey * kLeastStepGrey ? 1 : 0;
  }
  if (alike > kMostLikeMiddle) return std::nullopt;
  return cost;
}

}  // namespace rigcal::agent
