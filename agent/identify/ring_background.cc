// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/ring_background.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

constexpr double kArcPx = 3;  // length of an arc of the ring
constexpr int kMinArcs = 16, kMaxArcs = 64;
constexpr float kAlike = 0.4f;  // of the contrast: as near as this is the marker's colour
constexpr int kMinRingPixels = 24;

// One sigma of values around medians of some ten of them, without what does not belong to them.
double NoiseSigma(std::vector<float>* residuals) {
  const float limit = 2.5f * static_cast<float>(kSigmaOverMad) * (UpperMedian(residuals) + 0.5f);
  double squares = 0;
  int count = 0;
  for (const float residual : *residuals) {
    if (residual > limit) continue;
    squares += static_cast<double>(residual * residual);
    ++count;
  }
  // The cut leaves 0.95 of a Gaussian's variance; a median of few takes 5 % of it along.
  return std::max(0.5, std::sqrt(squares / (0.9 * std::max(1, count))));
}

}  // namespace

bool RingBackground::Read(const ImageView& image, const MarkerAperture& aperture,
                          const PixelRect& window, const Eigen::Vector3f& plateau_grey,
                          double* noise_grey) {
  const Eigen::Matrix2d ring = aperture.Grown(MarkerAperture::kMarginPx + MarkerAperture::kGapPx);
  const Eigen::Matrix2d edge =
      aperture.Grown(MarkerAperture::kMarginPx + MarkerAperture::kGapPx + aperture.ring_px);
  const int count =
      2 * std::clamp(  // each has an opposite one
              static_cast<int>(std::numbers::pi *
                               (aperture.b + MarkerAperture::kMarginPx + MarkerAperture::kGapPx) /
                               kArcPx),
              kMinArcs / 2, kMaxArcs / 2);
  arcs_.assign(static_cast<size_t>(count), Arc());
  struct RingPixel {
    float turn;  // 0 to count
    Eigen::Vector3f grey;
  };
  std::vector<RingPixel> pixels;
  ForPixels(window, aperture.centre_px, [&](size_t, int x, int y, const Eigen::Vector2d& d) {
    if (d.dot(ring * d) <= 1 || d.dot(edge * d) >= 1) return;
    const double turn = (std::atan2(d.y(), d.x()) / (2 * std::numbers::pi) + 0.5) * count;
    pixels.push_back({static_cast<float>(turn), GreyAt(image, x, y)});
  });
  if (pixels.size() < kMinRingPixels) return false;
  const int channels = image.format == PixelFormat::kMono8 ? 1 : 3;
  // Pixels of the ring that look like the marker belong to the next one.
  Eigen::Vector3f middle = Eigen::Vector3f::Zero();
  for (int c = 0; c < channels; ++c) {
    residuals_.clear();
    for (const RingPixel& pixel : pixels) residuals_.push_back(pixel.grey[c]);
    middle[c] = UpperMedian(&residuals_);
  }
  const float alike = kAlike * (plateau_grey - middle).norm();
  std::erase_if(pixels, [&](const RingPixel& p) { return (p.grey - plateau_grey).norm() < alike; });
  if (pixels.size() < kMinRingPixels / 2) return false;
  residuals_.clear();
  for (int k = 0; k < count; ++k) {
    for (auto& values : values_) values.clear();
    for (const RingPixel& pixel : pixels) {
      const float away =
          std::remainder(pixel.turn - static_cast<float>(k) - 0.5f, static_cast<float>(count));
      if (std::abs(away) > 0.8f) continue;
      for (int c = 0; c < channels; ++c) values_[c].push_back(pixel.grey[c]);
    }
    Arc& arc = arcs_[static_cast<size_t>(k)];
    arc.pixels = static_cast<int>(values_[0].size());
    if (arc.pixels == 0) continue;
    for (int c = 0; c < channels; ++c) {
      arc.background[c] = UpperMedian(&values_[c]);
      for (const float value : values_[c]) {
        residuals_.push_back(std::abs(value - arc.background[c]));
      }
    }
  }
  // Arcs without a pixel, outside of the image or hidden by a neighbour, are like the nearest
  // one.
  const std::vector<Arc> read = arcs_;
  for (int k = 0; k < count; ++k) {
    for (int step = 0; step <= count / 2 && arcs_[static_cast<size_t>(k)].pixels == 0; ++step) {
      const Arc& before = read[static_cast<size_t>((k - step + count) % count)];
      const Arc& after = read[static_cast<size_t>((k + step) % count)];
      arcs_[static_cast<size_t>(k)] = before.pixels >= after.pixels ? before : after;
    }
  }
  *noise_grey = NoiseSigma(&residuals_);
  return true;
}

Eigen::Vector3f RingBackground::At(const Eigen::Vector2d& offset, size_t* arc) const {
  const auto count = static_cast<double>(arcs_.size());
  const double turn =
      (std::atan2(offset.y(), offset.x()) / (2 * std::numbers::pi) + 0.5) * count - 0.5;
  const double low = std::floor(turn);
  const auto share = static_cast<float>(turn - low);
  const auto first = static_cast<size_t>(low + count) % arcs_.size();
  const size_t second = (first + 1) % arcs_.size();
  *arc = share < 0.5f ? first : second;
  return (1 - share) * arcs_[first].background + share * arcs_[second].background;
}

}  // namespace rigcal::agent
