// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/ring_background.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>

#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

constexpr int kMinArcs = 16, kMaxArcs = 64;
constexpr float kAlike = 0.4f;  // of the contrast: as near as this is the marker's colour
constexpr int kMinRingPixels = 24;
constexpr size_t kFewGreys = 32;
constexpr float kOverlap = 0.3f;  // of an arc, into each neighbour

// Direction of `d`, 0 to `turns`.
float TurnOf(const Eigen::Vector2d& d, float turns) {
  // atan to 1e-4 rad: arcs are a hundred times as long.
  const auto x = static_cast<float>(d.x()), y = static_cast<float>(d.y());
  const float ax = std::abs(x), ay = std::abs(y);
  const float low = std::min(ax, ay), high = std::max(ax, ay);
  const float t = high > 0 ? low / high : 0, t2 = t * t;
  float angle =
      t * (0.99997726f +
           t2 * (-0.33262347f +
                 t2 * (0.19354346f + t2 * (-0.11643287f + t2 * (0.05265332f - t2 * 0.01172120f)))));
  constexpr auto kPi = std::numbers::pi_v<float>;
  if (ay > ax) angle = 0.5f * kPi - angle;
  if (x < 0) angle = kPi - angle;
  if (y < 0) angle = -angle;
  return std::clamp((angle / (2 * kPi) + 0.5f) * turns, 0.0f, turns);
}

// The upper median of grey levels, which are whole numbers up to 255. Of many by counting them, of
// few by sorting them into place: faster than std::nth_element for these.
float MedianGrey(std::span<float> values) {
  const size_t middle = values.size() / 2;
  if (values.size() > kFewGreys) {
    std::array<int, 256> counts{};
    for (const float value : values) ++counts[static_cast<uint8_t>(value)];
    size_t grey = 0, below = 0;
    while ((below += static_cast<size_t>(counts[grey])) <= middle) ++grey;
    return static_cast<float>(grey);
  }
  for (size_t i = 1; i < values.size(); ++i) {
    const float value = values[i];
    size_t k = i;
    for (; k > 0 && values[k - 1] > value; --k) values[k] = values[k - 1];
    values[k] = value;
  }
  return values[middle];
}

// One sigma of values around medians of some ten of them, without what does not belong to them.
double NoiseSigma(std::span<float> residuals) {
  const float limit = 2.5f * static_cast<float>(kSigmaOverMad) * (MedianGrey(residuals) + 0.5f);
  double squares = 0;
  int count = 0;
  for (const float residual : residuals) {
    if (residual > limit) continue;
    squares += static_cast<double>(residual * residual);
    ++count;
  }
  // The cut leaves 0.95 of a Gaussian's variance; a median of few takes 5 % of it along.
  return std::max(0.5, std::sqrt(squares / (0.9 * std::max(1, count))));
}

}  // namespace

bool RingBackground::Read(const ImageView& image, const MarkerAperture& aperture,
                          const PixelGrid& window, const Eigen::Vector3f& plateau_grey,
                          const Ring& where, double* noise_grey) {
  const Eigen::Matrix2d ring = aperture.Grown(where.from_px);
  const Eigen::Matrix2d edge = aperture.Grown(where.from_px + where.width_px);
  const int count =
      2 * std::clamp(  // each has an opposite one
              static_cast<int>(std::numbers::pi * (aperture.b + where.from_px) / where.arc_px),
              kMinArcs / 2, kMaxArcs / 2);
  arcs_.assign(static_cast<size_t>(count), Arc());
  const auto turns = static_cast<float>(count);
  pixels_.clear();
  ForPixels(window, aperture.centre_px, [&](size_t, int x, int y, const Eigen::Vector2d& d) {
    if (d.dot(ring * d) <= 1 || d.dot(edge * d) >= 1) return;
    pixels_.push_back({TurnOf(d, turns), GreyAt(image, x, y)});
  });
  if (pixels_.size() < kMinRingPixels) return false;
  const int channels = image.format == PixelFormat::kMono8 ? 1 : 3;
  // Pixels of the ring that look like the marker belong to the next one.
  Eigen::Vector3f middle = Eigen::Vector3f::Zero();
  for (int c = 0; c < channels; ++c) {
    residuals_.clear();
    for (const RingPixel& pixel : pixels_) residuals_.push_back(pixel.grey[c]);
    middle[c] = MedianGrey(residuals_);
  }
  const float alike = kAlike * (plateau_grey - middle).norm();
  std::erase_if(pixels_, [&](const RingPixel& p) {
    return (p.grey - plateau_grey).squaredNorm() < alike * alike;
  });
  if (pixels_.size() < kMinRingPixels / 2) return false;
  // Arcs overlap: a pixel near an end also counts for the neighbour.
  by_arc_.resize(static_cast<size_t>(count));
  for (auto& members : by_arc_) members.clear();
  for (size_t i = 0; i < pixels_.size(); ++i) {
    const int arc = std::min(static_cast<int>(pixels_[i].turn), count - 1);
    const float share = pixels_[i].turn - static_cast<float>(arc);
    by_arc_[static_cast<size_t>(arc)].push_back(static_cast<int>(i));
    if (share <= kOverlap) {
      by_arc_[static_cast<size_t>((arc + count - 1) % count)].push_back(static_cast<int>(i));
    }
    if (share >= 1 - kOverlap) {
      by_arc_[static_cast<size_t>((arc + 1) % count)].push_back(static_cast<int>(i));
    }
  }
  residuals_.clear();
  for (int k = 0; k < count; ++k) {
    const std::vector<int>& members = by_arc_[static_cast<size_t>(k)];
    Arc& arc = arcs_[static_cast<size_t>(k)];
    arc.pixels = static_cast<int>(members.size());
    if (arc.pixels == 0) continue;
    for (int c = 0; c < channels; ++c) {
      values_.clear();
      for (const int i : members) values_.push_back(pixels_[static_cast<size_t>(i)].grey[c]);
      arc.background[c] = MedianGrey(values_);
      if (noise_grey == nullptr) continue;
      for (const float value : values_) residuals_.push_back(std::abs(value - arc.background[c]));
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
  if (noise_grey != nullptr) *noise_grey = residuals_.empty() ? 0.5 : NoiseSigma(residuals_);
  return true;
}

Eigen::Vector3f RingBackground::At(const Eigen::Vector2d& offset, size_t* arc) const {
  const auto count = static_cast<float>(arcs_.size());
  const float turn = TurnOf(offset, count) - 0.5f;
  const float low = std::floor(turn);
  const float share = turn - low;
  const size_t first = static_cast<size_t>(low + count) % arcs_.size();
  const size_t second = (first + 1) % arcs_.size();
  *arc = share < 0.5f ? first : second;
  return (1 - share) * arcs_[first].background + share * arcs_[second].background;
}

}  // namespace rigcal::agent
