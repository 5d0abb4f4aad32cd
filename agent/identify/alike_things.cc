// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/alike_things.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "agent/identify/ring_background.h"

namespace rigcal::agent {
namespace {

// Of the markers' radius.
constexpr double kLeastSize = 0.75, kMostSize = 1.33, kLeastSizeInRow = 0.65, kMostSizeInRow = 1.5,
                 kSizeOffPx = 0.5;
constexpr double kOnRow = 0.6, kApart = 1.3;  // radii
constexpr double kRowReach = 1.2;             // of the longest span, beyond the ends
constexpr double kNearBy = 1.5;               // of the length, from the middle
constexpr float kSameLookColour = 0.06f;      // rad
constexpr float kSameLook = 0.25f;            // of the brightness
constexpr int kLookPx = 1;                    // around the middle

Eigen::Vector3f LookAt(const ImageView& image, const Eigen::Vector2d& at_px) {
  const auto within = [](double at, int size) {
    return std::clamp(static_cast<int>(std::lround(at)), kLookPx, size - 1 - kLookPx);
  };
  const int x0 = within(at_px.x(), image.width), y0 = within(at_px.y(), image.height);
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (int y = y0 - kLookPx; y <= y0 + kLookPx; ++y) {
    for (int x = x0 - kLookPx; x <= x0 + kLookPx; ++x) sum += GreyAt(image, x, y);
  }
  constexpr int kSide = 2 * kLookPx + 1;
  return sum / (kSide * kSide);
}

}  // namespace

AlikeThings ThingsLike(const ImageView& image, absl::Span<const Blob> blobs,
                       const VerifiedWand& wand) {
  AlikeThings things;
  if (wand.centres.size() < 2) return things;
  double radius_px = 0;
  int count = 0;
  Eigen::Vector3f look = Eigen::Vector3f::Zero();
  for (size_t k = 0; k < wand.centres.size(); ++k) {
    if (!wand.whole[k]) continue;
    radius_px += wand.centres[k].radius_px;
    look += LookAt(image, wand.centres[k].centre_px);
    ++count;
  }
  if (count == 0) return things;
  radius_px /= count;
  look /= static_cast<float>(count);
  const Eigen::Vector2d first = wand.centres.front().centre_px;
  const Eigen::Vector2d way = wand.centres.back().centre_px - first;
  const double length_px = way.norm();
  const Eigen::Vector2d unit = way / length_px;
  double span_px = 0;
  for (size_t k = 1; k < wand.centres.size(); ++k) {
    span_px = std::max(span_px, (wand.centres[k].centre_px - wand.centres[k - 1].centre_px).norm());
  }
  const auto is_as_large = [radius_px](const Blob& blob, double least, double most) {
    const double its_px = std::sqrt(blob.area_px / std::numbers::pi);
    return its_px >= least * radius_px - kSizeOffPx && its_px <= most * radius_px + kSizeOffPx;
  };
  const Eigen::Vector2d middle = first + 0.5 * way;
  for (const Blob& blob : blobs) {
    if (!is_as_large(blob, kLeastSizeInRow, kMostSizeInRow)) continue;
    const bool is_its_own = std::ranges::any_of(wand.centres, [&](const MarkerCentre& centre) {
      return (blob.centre_px - centre.centre_px).norm() < kApart * radius_px;
    });
    if (is_its_own) continue;
    const Eigen::Vector3f its_look = LookAt(image, blob.centre_px);
    if (!((its_look - look).norm() < kSameLook * look.norm())) continue;
    if (is_as_large(blob, kLeastSize, kMostSize) &&
        (blob.centre_px - middle).norm() < kNearBy * length_px &&
        (its_look.normalized() - look.normalized()).norm() < kSameLookColour) {
      ++things.near_count;
    }
    const Eigen::Vector2d to = blob.centre_px - first;
    const double along_px = unit.dot(to);
    things.go_on_as_row |= std::abs(unit.x() * to.y() - unit.y() * to.x()) <= kOnRow * radius_px &&
                           along_px >= -kRowReach * span_px &&
                           along_px <= length_px + kRowReach * span_px;
  }
  return things;
}

}  // namespace rigcal::agent
