// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/other_spacing.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "absl/strings/str_format.h"
#include "agent/detect/frame/spot_likeness.h"

namespace rigcal::agent {
namespace {

constexpr size_t kMostSpots = 12;      // with more it is a room, not a wand
constexpr double kLeastRadiusPx = 3;   // smaller things all look alike
constexpr double kMostUnlikeness = 3;  // chi-squared, see Unlikeness
constexpr double kLikeSize = 0.12;     // largest relative difference of the radii and distances
constexpr double kOffLine = 0.25;  // of a radius, largest distance of the middle one from the line
constexpr double kLeastApart = 2.5;  // radii between the middle and the nearer end
// The middle one is elsewhere if its share differs by this. A tilt changes the share by a quarter
// of the distances' relative difference, 0.03 with kLikeSize.
constexpr double kOtherShare = 0.045;
constexpr double kSmaller = 0.75, kLarger = 1.6;  // size ratios; a tilt of 50 degrees gives 1.56

struct Disc {
  int spot;
  Eigen::Vector2d flat;  // on the plane z = 1, without distortion
  double radius;         // on that plane
};

// Returns the size ratio of other spheres, else 0. Tilt makes a wand short, its spheres large.
double SizeRatio(const WandFinder& finder, const Disc& first, const Disc& middle,
                 const Disc& last) {
  const double told = 0.5 * finder.fit_options().diameter_m / finder.length_m();
  if (!(told > 0)) return 0;
  const double seen = (first.radius + middle.radius + last.radius) / 3;
  const double ratio = seen / (told * (last.flat - first.flat).norm());
  return ratio < kSmaller || ratio > kLarger ? ratio : 0;
}

}  // namespace

OtherWand FindOtherWand(absl::Span<const Spot> spots, const WandFinder& finder) {
  if (finder.shares().size() != 3 || spots.size() < 3 || spots.size() > kMostSpots) return {};
  const double told = std::min(finder.shares()[1], 1 - finder.shares()[1]);
  std::vector<Disc> discs;
  for (size_t i = 0; i < spots.size(); ++i) {
    const double radius_px = std::sqrt(spots[i].blob.area_px / std::numbers::pi);
    MarkerSight sight;
    if (radius_px < kLeastRadiusPx || !finder.Sight(spots[i].blob.centre_px, &sight)) continue;
    discs.push_back(
        {static_cast<int>(i), sight.ray.hnormalized(), radius_px / sight.scale_px / sight.ray.z()});
  }
  OtherWand found;
  bool has_found = false;
  for (size_t first = 0; first < discs.size(); ++first) {
    for (size_t last = first + 1; last < discs.size(); ++last) {
      const Eigen::Vector2d line = discs[last].flat - discs[first].flat;
      for (size_t middle = 0; middle < discs.size(); ++middle) {
        if (middle == first || middle == last) continue;
        const Eigen::Vector2d way = discs[middle].flat - discs[first].flat;
        const double share = way.dot(line) / line.squaredNorm();
        const auto [least, most] =
            std::minmax({discs[first].radius, discs[middle].radius, discs[last].radius});
        const double nearer = std::min(share, 1 - share);
        if (nearer * line.norm() < kLeastApart * most || most > (1 + kLikeSize) * least ||
            (way - share * line).norm() > kOffLine * least) {
          continue;
        }
        const WandCandidate three{
            .blobs = {discs[first].spot, discs[middle].spot, discs[last].spot}, .fit = {}};
        if (Unlikeness(spots, three) > kMostUnlikeness) continue;
        if (has_found) return {};
        has_found = true;
        if (std::abs(nearer - told) >= kOtherShare) {
          found.middle_share = nearer;
        } else {
          found.size_ratio = SizeRatio(finder, discs[first], discs[middle], discs[last]);
        }
      }
    }
  }
  return found;
}

std::string OtherWandText(const Detection& detection, const Target& target) {
  if (detection.other_size_ratio > 0) {
    return absl::StrFormat(
        "three like spheres are spaced as the target says, but look %.2g times as large for their "
        "distance as a diameter of %g m does. Check diameter= and the positions of --target "
        "(metres)",
        detection.other_size_ratio, target.diameter_m);
  }
  if (detection.other_middle_share > 0) {
    const double told = target.marker_positions_m[1] / target.marker_positions_m.back();
    return absl::StrFormat(
        "three like spheres in line are no wand as told: the middle one is at %.2f of their "
        "distance, the target says %.2f. Check --target",
        detection.other_middle_share, std::min(told, 1 - told));
  }
  return "";
}

}  // namespace rigcal::agent
