// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/wand_track.h"

#include <algorithm>
#include <cmath>

namespace rigcal::agent {
namespace {

constexpr int64_t kLongestPauseNs = 250'000'000;
constexpr double kMarginPx = 24;         // around the outermost sphere, if its velocity is known
constexpr double kFirstMarginPx = 96;    // if it is not
constexpr double kVelocityShare = 0.75;  // of the predicted way, as the wand may turn

}  // namespace

void WandTrack::Add(int64_t time_ns, uint32_t clock_epoch, const Points& centres_px,
                    double radius_px) {
  const bool follows = last_.has_value() && clock_epoch == clock_epoch_ &&
                       time_ns > last_->time_ns && time_ns - last_->time_ns <= kLongestPauseNs;
  before_ = follows ? last_ : std::nullopt;
  last_ = Sighting{time_ns, centres_px};
  clock_epoch_ = clock_epoch;
  radius_px_ = radius_px;
}

std::optional<Eigen::Vector2d> WandTrack::Velocity(size_t marker) const {
  if (!last_.has_value() || !before_.has_value()) return std::nullopt;
  const double passed_s = 1e-9 * static_cast<double>(last_->time_ns - before_->time_ns);
  return Eigen::Vector2d((last_->centres_px[marker] - before_->centres_px[marker]) / passed_s);
}

std::optional<PixelRect> WandTrack::Window(int64_t time_ns, uint32_t clock_epoch,
                                           const PixelRect& bounds) const {
  if (!last_.has_value() || clock_epoch != clock_epoch_ || time_ns <= last_->time_ns ||
      time_ns - last_->time_ns > kLongestPauseNs) {
    return std::nullopt;
  }
  const double ahead_s = 1e-9 * static_cast<double>(time_ns - last_->time_ns);
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
  double way_px = 0;
  for (size_t k = 0; k < last_->centres_px.size(); ++k) {
    const Eigen::Vector2d step = ahead_s * Velocity(k).value_or(Eigen::Vector2d::Zero());
    low = low.cwiseMin(last_->centres_px[k] + step);
    high = high.cwiseMax(last_->centres_px[k] + step);
    way_px = std::max(way_px, step.norm());
  }
  const double margin =
      2 * radius_px_ + kVelocityShare * way_px + (before_.has_value() ? kMarginPx : kFirstMarginPx);
  const auto clip = [](double value, int size) {
    return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(size)));
  };
  const int x0 = clip(std::floor(low.x() - margin), bounds.width);
  const int y0 = clip(std::floor(low.y() - margin), bounds.height);
  const PixelRect window{x0, y0, clip(std::ceil(high.x() + margin), bounds.width) - x0,
                         clip(std::ceil(high.y() + margin), bounds.height) - y0};
  if (window.empty()) return std::nullopt;
  return window;
}

}  // namespace rigcal::agent
