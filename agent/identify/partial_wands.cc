// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/partial_wands.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

namespace rigcal::agent {
namespace {

constexpr size_t kMarkers = 3;
constexpr double kMaxRatio = 1.5;      // of the radii of two markers
constexpr double kPerspective = 0.35;  // that much nearer or farther along the line, relative
constexpr double kLargestPart = 1.3;   // of a marker's area
constexpr double kPartSigma = 0.5;     // radii; the centre of a part is within the marker
constexpr double kWholePlacePx = 0.3, kWholePlaceShare = 0.03;
constexpr double kWholeRadiusPx = 0.35, kWholeRadiusShare = 0.06;
constexpr double kMaxPartialCost = 14;
constexpr int kMaxPartialFits = 150;

double RadiusOf(const Blob& blob) { return std::sqrt(blob.area_px / std::numbers::pi); }

}  // namespace

void LoosenSight(double radius_px, MarkerSight* sight) {
  sight->sigma_px = kPartSigma * radius_px + 0.5;
  sight->radius_px = radius_px;
  sight->radius_sigma_px = 10 * radius_px;
}

std::vector<WandCandidate> FindPartialWands(const WandFinder& finder, absl::Span<const Blob> blobs,
                                            size_t whole_count, size_t max_candidates) {
  std::vector<WandCandidate> candidates;
  if (finder.shares().size() != kMarkers) return candidates;
  const auto sight_of = [&](const Blob& blob, MarkerSight* sight) {
    if (!finder.Sight(blob.centre_px, sight)) return false;
    const double radius = RadiusOf(blob);
    sight->radius_px = radius;
    sight->sigma_px = kWholePlacePx + kWholePlaceShare * radius;
    sight->radius_sigma_px = kWholeRadiusPx + kWholeRadiusShare * radius;
    return true;
  };
  int fits = 0;
  for (size_t i = 0; i < whole_count; ++i) {
    for (size_t j = 0; j < whole_count; ++j) {
      const double ri = RadiusOf(blobs[i]), rj = RadiusOf(blobs[j]);
      if (i == j || ri > kMaxRatio * rj || rj > kMaxRatio * ri) continue;
      const Eigen::Vector2d line = blobs[j].centre_px - blobs[i].centre_px;
      const double squared = line.squaredNorm(), radius = std::max(ri, rj);
      if (squared < radius * radius) continue;
      for (size_t p = 0; p < blobs.size(); ++p) {
        if (p == i || p == j ||
            blobs[p].area_px > kLargestPart * std::numbers::pi * radius * radius) {
          continue;
        }
        const Eigen::Vector2d d = blobs[p].centre_px - blobs[i].centre_px;
        const double across = (d.x() * line.y() - d.y() * line.x()) / std::sqrt(squared);
        if (std::abs(across) > radius + 1) continue;
        const double at = d.dot(line) / squared;
        for (size_t part = 0; part < kMarkers; ++part) {
          // i and j are the other two, in the wand's order.
          const size_t first = part == 0 ? 1 : 0, second = part == 2 ? 1 : 2;
          const double span = finder.shares()[second] - finder.shares()[first];
          const double expected = (finder.shares()[part] - finder.shares()[first]) / span;
          const double slack =
              kPerspective * std::abs(expected) * std::max(0.3, std::abs(1 - expected)) +
              (radius + 1) / std::sqrt(squared);
          if (std::abs(at - expected) > slack || ++fits > kMaxPartialFits) continue;
          absl::InlinedVector<MarkerSight, 4> sights(kMarkers);
          WandCandidate candidate;
          candidate.partial = static_cast<int>(part);
          candidate.blobs.resize(kMarkers);
          candidate.blobs[first] = static_cast<int>(i);
          candidate.blobs[second] = static_cast<int>(j);
          candidate.blobs[part] = static_cast<int>(p);
          if (!sight_of(blobs[i], &sights[first]) || !sight_of(blobs[j], &sights[second]) ||
              !sight_of(blobs[p], &sights[part])) {
            continue;
          }
          LoosenSight(0.5 * (ri + rj), &sights[part]);
          if (!FitWand(sights, finder.shares(), finder.length_m(), finder.fit_options(),
                       &candidate.fit) ||
              candidate.fit.cost > kMaxPartialCost) {
            continue;
          }
          candidates.push_back(candidate);
        }
      }
    }
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const WandCandidate& a, const WandCandidate& b) {
              return std::tie(a.fit.cost, a.blobs) < std::tie(b.fit.cost, b.blobs);
            });
  if (candidates.size() > max_candidates) candidates.resize(max_candidates);
  return candidates;
}

}  // namespace rigcal::agent
