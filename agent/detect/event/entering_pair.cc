// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/entering_pair.h"

#include <algorithm>
#include <cmath>

namespace rigcal::agent {
namespace {

// In chi-squared: a way of more is not possible, and one of more is not taken.
constexpr double kPossibleCost = 9, kTakenCost = 1;
// Of the wand out of the plane across the line of sight, of the way that is taken.
constexpr double kMostTiltRad = 1.05;
// Of the way to the third marker: how far it may be from where it is expected, since the sizes do
// not say which end is nearer.
constexpr double kPlaceShare = 0.2;
// Pixels answer up to so far outside a sphere.
constexpr double kAnswerRimPx = 1.5;

// How far within the image; negative: outside.
double InsidePx(const Eigen::Vector2d& at, const SensorGeometry& geometry) {
  return std::min(
      {at.x() + 0.5, geometry.width - 0.5 - at.x(), at.y() + 0.5, geometry.height - 0.5 - at.y()});
}

}  // namespace

std::optional<EnteringPair> FindEnteringPair(const WandFinder& finder,
                                             const SensorGeometry& geometry,
                                             absl::Span<const int> kinds,
                                             const std::array<SeenMarker, 2>& seen) {
  const absl::Span<const double> shares = finder.shares();
  if (shares.size() != 3 || !(finder.fit_options().diameter_m > 0)) return std::nullopt;
  EnteringPair taken;
  bool is_taken = false;
  int possible = 0;
  for (int first = 0; first < 3; ++first) {
    for (int last = 0; last < 3; ++last) {
      const int other = 3 - first - last;
      // A middle one would be between them, within the image.
      if (first == last || other == 1) continue;
      const auto share = [&](int marker) { return shares[static_cast<size_t>(marker)]; };
      const auto is_kind = [&](int marker, const SeenMarker& one) {
        return kinds.empty() || kinds[static_cast<size_t>(marker)] == one.kind;
      };
      if (!is_kind(first, seen[0]) || !is_kind(last, seen[1])) continue;
      const double ends[] = {0, 1};
      const MarkerSight sights[] = {seen[0].sight, seen[1].sight};
      const double apart = share(last) - share(first);
      WandImageFit fit;
      if (!FitWand(sights, ends, std::abs(apart) * finder.length_m(), finder.fit_options(), &fit) ||
          fit.cost > kPossibleCost) {
        continue;
      }
      const Eigen::Vector3d along = (fit.last_m - fit.first_m) / apart;
      EnteringPair pair{.markers = {first, last},
                        .other = other,
                        .is_in_lens = false,
                        .other_px = Eigen::Vector2d::Zero(),
                        .other_radius_px = 0,
                        .fit = fit};
      pair.fit.first_m = fit.first_m - share(first) * along;
      pair.fit.last_m = pair.fit.first_m + along;
      const double on = (share(other) - share(first)) / apart;
      const Eigen::Vector3d other_m = fit.first_m + on * (fit.last_m - fit.first_m);
      pair.other_radius_px = seen[0].sight.radius_px * fit.first_m.norm() / other_m.norm();
      // With the perspective of the fit, and without.
      const Eigen::Vector2d flat_px =
          seen[0].centre_px + on * (seen[1].centre_px - seen[0].centre_px);
      double inside_px = InsidePx(flat_px, geometry);
      pair.is_in_lens = other_m.z() > 0 && finder.ImageOf(other_m, &pair.other_px);
      if (pair.is_in_lens) inside_px = std::min(inside_px, InsidePx(pair.other_px, geometry));
      const double away_px =
          std::min((flat_px - seen[0].centre_px).norm(), (flat_px - seen[1].centre_px).norm());
      // It would be seen whole.
      if (inside_px > pair.other_radius_px + kAnswerRimPx + kPlaceShare * away_px) continue;
      ++possible;
      const bool is_hidden = !pair.is_in_lens || InsidePx(pair.other_px, geometry) <
                                                     pair.other_radius_px + kAnswerRimPx;
      if (is_hidden && fit.cost < kTakenCost && std::abs(fit.tilt_rad) < kMostTiltRad) {
        taken = pair;
        is_taken = true;
      }
    }
  }
  if (possible != 1 || !is_taken) return std::nullopt;
  return taken;
}

}  // namespace rigcal::agent
