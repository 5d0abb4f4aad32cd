// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/alike_pairs.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "agent/identify/squared.h"
#include "agent/identify/stick_sight.h"

namespace rigcal::agent {
namespace {

constexpr size_t kMaxAlikePairs = 30;
constexpr double kPairBrightness = 0.3, kPairColour = 0.12, kMaxPairCost = 12;
constexpr double kSmallerPx = 0.5;   // than by radii: the mask leaves out the rim
constexpr size_t kMostSticks = 150;  // pairs
constexpr double kStickGain = 3;
// Of pairs that are as much alike the larger first: small things are many. Per e-fold of the size.
constexpr double kSmaller = 0.5;

}  // namespace

double RadiusOf(const Blob& blob) { return std::sqrt(blob.area_px / std::numbers::pi); }

std::vector<AlikePair> AlikePairs(const ImageView& image, absl::Span<const WholeMarker> wholes,
                                  double longest_radii, bool look_for_stick, double* work) {
  std::vector<AlikePair> pairs;
  for (size_t i = 0; i < wholes.size(); ++i) {
    for (size_t j = i + 1; j < wholes.size(); ++j) {
      const WholeMarker &a = wholes[i], &b = wholes[j];
      const double ri = RadiusOf(a.blob), rj = RadiusOf(b.blob);
      if (ri > 1.6 * rj + 1 || rj > 1.6 * ri + 1) continue;
      const double apart_px = (a.blob.centre_px - b.blob.centre_px).norm();
      if (apart_px < ri + rj || apart_px > longest_radii * (0.5 * (ri + rj) + kSmallerPx)) continue;
      const float ga = std::max(1.0f, a.core.norm()), gb = std::max(1.0f, b.core.norm());
      const double cost =
          Squared(static_cast<double>(std::log(ga / gb)) / kPairBrightness) +
          static_cast<double>((a.core / ga - b.core / gb).squaredNorm()) / Squared(kPairColour) +
          a.doubt + b.doubt;
      if (cost > kMaxPairCost) continue;
      pairs.push_back(
          {.cost = cost, .rank = cost - kSmaller * std::log(ri * rj), .first = i, .last = j});
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const AlikePair& a, const AlikePair& b) {
    return std::tie(a.rank, a.first, a.last) < std::tie(b.rank, b.first, b.last);
  });
  if (pairs.size() > kMostSticks) pairs.resize(kMostSticks);
  for (AlikePair& pair : pairs) {
    if (!look_for_stick) break;
    *work -= kWorkOfStick;
    const Blob &a = wholes[pair.first].blob, &b = wholes[pair.last].blob;
    const double ra = RadiusOf(a), rb = RadiusOf(b);
    pair.has_stick =
        StickBetween(image, a.centre_px, ra, b.centre_px, rb, 0.5 * (ra + rb)).value_or(0) >=
        kStickSeen;
    if (!pair.has_stick) continue;
    pair.rank -= kStickGain;
    pair.cost = std::max(0.0, pair.cost - kStickGain);
  }
  std::sort(pairs.begin(), pairs.end(), [](const AlikePair& a, const AlikePair& b) {
    if (a.has_stick != b.has_stick) return a.has_stick;
    return std::tie(a.rank, a.first, a.last) < std::tie(b.rank, b.first, b.last);
  });
  if (pairs.size() > kMaxAlikePairs) pairs.resize(kMaxAlikePairs);
  return pairs;
}

}  // namespace rigcal::agent
