// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/partial_wands.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <tuple>

#include "agent/identify/hidden_part.h"
#include "agent/identify/squared.h"
#include "agent/identify/stick_sight.h"
#include "agent/identify/third_marker.h"
#include "agent/identify/whole_candidate.h"

namespace rigcal::agent {
namespace {

constexpr size_t kMarkers = 3;
constexpr double kPartSigma = 0.5;  // radii; the centre of a part is within the marker
constexpr double kWholePlacePx = 0.3, kWholePlaceShare = 0.03;
constexpr double kWholeRadiusPx = 0.35, kWholeRadiusShare = 0.08;
constexpr double kMaxPartialCost = 14;
constexpr double kWorkOfThirds = 2500;  // in pixels, where markers are that nothing found
constexpr double kMostThirdCost = 6;    // of a wand with such a marker
constexpr double kSliverPairCost = 4;   // of two markers that are worth the look
constexpr double kLongest = 1.1;        // than by radii
constexpr double kMaxSizeCost = 9;
// Of the stick.
constexpr double kNoStickCost = 4;
constexpr double kInterrupted = 0.25, kCoveredCost = 3;  // where the middle one is covered
constexpr double kCommonRadiusPx = 0.8;                  // of both, by blur and the mask's limit
constexpr double kStepRadii = 0.25;  // along the line, between places that are looked at
constexpr int kSteps = 48;           // of the ratio of their depths
constexpr double kLargestPart = 1.3, kKnownCost = 0.5;
constexpr double kLeastConfidence = 0.88, kTriedOdds = 2.5, kDarkTriedOdds = 0.85, kFewPlaces = 150;

MarkerSight SightOf(const Blob& blob, const MarkerSight& ray) {
  MarkerSight sight = ray;
  sight.radius_px = RadiusOf(blob);
  sight.sigma_px = kWholePlacePx + kWholePlaceShare * sight.radius_px;
  sight.radius_sigma_px = kWholeRadiusPx + kWholeRadiusShare * sight.radius_px;
  return sight;
}

// Where a marker must be, if the other two are so far away.
struct Place {
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();  // z = 1
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  double radius_px = 0;
  double size_cost = 0;
};

// Where a whole marker is seen that nothing found, and what it costs.
struct ThirdPlace {
  Place place;
  double cost = 0;
};

// Two of the three markers, in the wand's order, and the one that is hidden.
struct Layout {
  size_t first, second, hidden;
};
constexpr Layout kLayouts[] = {{1, 2, 0}, {0, 2, 1}, {0, 1, 2}};

class PartSearch {
 public:
  PartSearch(const ImageView& image, const WandFinder& finder, absl::Span<const Blob> known_parts,
             double* third_work, double* work, PartialWands* found)
      : known_parts_(known_parts),
        image_(image),
        finder_(finder),
        third_work_(*third_work),
        work_(*work),
        found_(*found) {}

  // `a` and `b` are markers first and second.
  void Try(const WholeMarker& a, const WholeMarker& b, size_t index_a, size_t index_b,
           const MarkerSight& sight_a, const MarkerSight& sight_b, const Layout& layout,
           const AlikePair& pair) {
    const double pair_cost = pair.cost;
    const WandImageFitOptions& options = finder_.fit_options();
    const auto shares = finder_.shares();
    const double span = shares[layout.second] - shares[layout.first];
    const double at = (shares[layout.hidden] - shares[layout.first]) / span;
    const double span_m = span * finder_.length_m();
    // Limits of the depth of the second over that of the first.
    const double width = (sight_a.ray - sight_b.ray).norm();
    const double half = std::min(0.6, 0.5 * width * std::tan(options.max_tilt_rad));
    const double low = (1 - half) / (1 + half), high = (1 + half) / (1 - half);
    const Eigen::Vector3f core = 0.5f * (a.core + b.core);
    const double radius = 0.5 * (sight_a.radius_px + sight_b.radius_px);
    std::optional<HiddenPart> best;
    std::optional<Place> place, best_place;
    std::optional<ThirdPlace> third;
    const auto look = [&] {
      if (!finder_.ImageOf(place->ray, &place->centre_px)) return;
      ++found_.tried;
      LookForThird(*place, core, &third);
      std::optional<HiddenPart> part =
          LookForPart(image_, place->centre_px, place->radius_px, core, pair.has_stick, &work_);
      if (!part) part = KnownAt(place->centre_px, place->radius_px, a, b);
      if (!part && pair_cost < kSliverPairCost) {
        part =
            LookForSliver(image_, place->centre_px, place->radius_px, core, pair.has_stick, &work_);
      }
      if (!part && pair.has_stick && layout.hidden == 1) part = CoveredAt(*place, a.blob, b.blob);
      if (!part) return;
      part->size_cost = place->size_cost;
      part->cost += place->size_cost;
      if (pair.has_stick && layout.hidden != 1) {
        part->cost += kNoStickCost * (1 - StickTo(*place, layout.hidden == 0 ? a.blob : b.blob));
      }
      if (!best || part->cost < best->cost ||
          (part->cost == best->cost && part->share > best->share)) {
        best = part;
        best_place = place;
      }
    };
    Eigen::Vector3d begin = Eigen::Vector3d::Zero();
    const double scale_px = 0.5 * (sight_a.scale_px + sight_b.scale_px);
    const double factor = std::pow(high / low, 1.0 / kSteps);
    double ratio = low / factor;
    for (int i = 0; i <= kSteps; ++i) {
      ratio *= factor;
      const Eigen::Vector3d line = ratio * sight_b.ray - sight_a.ray;
      const double first_m = span_m / line.norm();
      const double size_cost = SizeCost(sight_a, sight_b, first_m, ratio * first_m);
      if (!(size_cost <= kMaxSizeCost)) continue;
      const Eigen::Vector3d hidden = sight_a.ray + at * line;
      Place next{.size_cost = size_cost};
      if (!(hidden.z() > 0)) continue;
      next.ray = hidden / hidden.z();
      next.radius_px = 0.5 * (sight_a.radius_px + ratio * sight_b.radius_px) / hidden.norm();
      if (work_ <= 0) {
        found_.cut_short = true;
        found_.cut_stick |= pair.has_stick;
        return;
      }
      // Of places that are nearly the same the one that fits the sizes best.
      const bool moved =
          place && scale_px * (next.ray - begin).norm() > kStepRadii * next.radius_px;
      if (moved) look();
      if (!place || moved) begin = next.ray;
      if (!place || moved || next.size_cost < place->size_cost) place = next;
    }
    if (place) look();
    WandCandidate candidate;
    candidate.blobs.resize(kMarkers);
    candidate.blobs[layout.first] = static_cast<int>(index_a);
    candidate.blobs[layout.second] = static_cast<int>(index_b);
    absl::InlinedVector<MarkerSight, 4> sights(kMarkers);
    sights[layout.first] = sight_a;
    sights[layout.second] = sight_b;
    // Fits the other two and a marker that is somewhere around `disc`.
    const auto fit = [&](const Blob& disc, WandCandidate* its) {
      MarkerSight& sight = sights[layout.hidden];
      if (!finder_.Sight(disc.centre_px, &sight)) return false;
      LoosenSight(radius, &sight);
      its->blobs[layout.hidden] = static_cast<int>(found_.blobs.size());
      return FitWand(sights, shares, finder_.length_m(), options, &its->fit) &&
             its->fit.cost <= kMaxPartialCost;
    };
    if (third) {
      WandCandidate whole = candidate;
      const Blob disc = DiscBlob(third->place.centre_px, third->place.radius_px);
      if (fit(disc, &whole)) {
        whole.cost = whole.fit.cost + pair_cost + third->cost;
        if (whole.cost < kMostThirdCost) {
          found_.blobs.push_back(disc);
          found_.thirds.push_back(std::move(whole));
        }
      }
    }
    if (!best) return;
    candidate.partial = static_cast<int>(layout.hidden);
    candidate.has_stick = pair.has_stick;
    best->blob.centre_px =
        MiddleBeyondBorder(image_, best->blob, best_place->centre_px, best_place->radius_px);
    if (!fit(best->blob, &candidate)) return;
    candidate.cost = candidate.fit.cost + pair_cost + best->cost;
    candidate.partial_cost = best->cost;
    candidate.partial_size_cost = best->size_cost;
    candidate.partial_share = best->share;
    candidate.partial_around = best->around;
    candidate.is_sliver = best->is_sliver;
    found_.blobs.push_back(best->blob);
    found_.candidates.push_back(candidate);
  }

 private:
  void LookForThird(const Place& place, const Eigen::Vector3f& core,
                    std::optional<ThirdPlace>* third) {
    if (third_work_ <= 0) return;
    const auto cost = ThirdMarkerCost(image_, place.centre_px, place.radius_px, core, &third_work_);
    if (!cost || (*third && (*third)->cost <= *cost + place.size_cost)) return;
    *third = ThirdPlace{place, *cost + place.size_cost};
  }

  // A sliver is darker than a whole marker, but where little has the wand's colour it may be known.
  std::optional<HiddenPart> KnownAt(const Eigen::Vector2d& centre_px, double radius_px,
                                    const WholeMarker& a, const WholeMarker& b) const {
    const double area_px = std::numbers::pi * radius_px * radius_px;
    for (const Blob& blob : known_parts_) {
      if ((blob.centre_px - centre_px).norm() > radius_px ||
          blob.area_px > kLargestPart * area_px || IsSmallThing(blob.area_px / area_px, blob) ||
          (blob.centre_px - a.blob.centre_px).norm() < radius_px ||
          (blob.centre_px - b.blob.centre_px).norm() < radius_px) {
        continue;
      }
      return HiddenPart{.share = 0, .around = 0, .cost = kKnownCost, .blob = blob};
    }
    return std::nullopt;
  }

  // Where the stick is seen between the other two, it is seen from the nearer one to the third.
  double StickTo(const Place& place, const Blob& nearer) {
    work_ -= kWorkOfStick;
    return StickBetween(image_, nearer.centre_px, RadiusOf(nearer), place.centre_px,
                        place.radius_px, place.radius_px)
        .value_or(0.5);
  }

  // Something covers the stick where the marker must be, and where it would be the other way round
  // the stick is seen.
  std::optional<HiddenPart> CoveredAt(const Place& place, const Blob& a, const Blob& b) {
    const Eigen::Vector2d way = (b.centre_px - a.centre_px).normalized();
    const auto seen_at = [&](const Eigen::Vector2d& at_px) {
      work_ -= kWorkOfStick;
      const Eigen::Vector2d half_px = place.radius_px * way;
      return StickShare(image_, at_px - half_px, at_px + half_px, place.radius_px);
    };
    if (seen_at(place.centre_px) > kInterrupted ||
        seen_at(a.centre_px + b.centre_px - place.centre_px) < kStickSeen) {
      return std::nullopt;
    }
    return HiddenPart{.share = 0,
                      .around = 0,
                      .cost = kCoveredCost,
                      .blob = DiscBlob(place.centre_px, place.radius_px)};
  }

  double SizeCost(const MarkerSight& a, const MarkerSight& b, double first_m,
                  double second_m) const {
    const WandImageFitOptions& options = finder_.fit_options();
    if (!(std::min(first_m, second_m) >= options.min_distance_m) ||
        !(std::max(first_m, second_m) <= options.max_distance_m)) {
      return 2 * kMaxSizeCost;
    }
    if (options.diameter_m > 0) {
      const auto excess_px = [&](const MarkerSight& sight, double distance_m) {
        return sight.radius_px - 0.5 * options.diameter_m * sight.scale_px / distance_m;
      };
      const double of_a = excess_px(a, first_m), of_b = excess_px(b, second_m);
      const double variance = Squared(a.radius_sigma_px);
      return Squared(0.5 * (of_a + of_b)) / (Squared(kCommonRadiusPx) + 0.5 * variance) +
             Squared(of_a - of_b) / (2 * variance);
    }
    const double difference_px =
        a.radius_px - b.radius_px * second_m / first_m * a.scale_px / b.scale_px;
    return Squared(difference_px / (1.5 * a.radius_sigma_px));
  }

  absl::Span<const Blob> known_parts_;
  const ImageView& image_;
  const WandFinder& finder_;
  double& third_work_;
  double& work_;
  PartialWands& found_;
};

}  // namespace

double LeastPartialConfidence(int tried, bool in_room) {
  const double odds = kLeastConfidence / (1 - kLeastConfidence) *
                      std::pow(1 + tried / kFewPlaces, in_room ? kTriedOdds : kDarkTriedOdds);
  return odds / (1 + odds);
}

void LoosenSight(double radius_px, MarkerSight* sight) {
  sight->sigma_px = kPartSigma * radius_px + 0.5;
  sight->radius_px = radius_px;
  sight->radius_sigma_px = 10 * radius_px;
}

PartialWands FindPartialWands(const ImageView& image, const WandFinder& finder,
                              absl::Span<const WholeMarker> wholes,
                              absl::Span<const Blob> known_parts, size_t max_candidates,
                              double* work, bool look_for_third, bool look_for_stick) {
  PartialWands found;
  if (finder.shares().size() != kMarkers) return found;
  for (const WholeMarker& whole : wholes) found.blobs.push_back(whole.blob);
  const double most_third_work = look_for_third ? kWorkOfThirds : 0;
  double third_work = most_third_work;
  PartSearch search(image, finder, known_parts, &third_work, work, &found);
  // Of a wand across the line of sight; no other one is longer in the image.
  const double diameter_m = finder.fit_options().diameter_m;
  const double longest_radii = diameter_m > 0 ? kLongest * 2 * finder.length_m() / diameter_m
                                              : std::numeric_limits<double>::infinity();
  std::vector<std::optional<MarkerSight>> rays;
  for (const WholeMarker& whole : wholes) {
    MarkerSight ray;
    const bool is_seen = finder.Sight(whole.blob.centre_px, &ray);
    rays.push_back(is_seen ? std::optional(ray) : std::nullopt);
  }
  for (const AlikePair& pair : AlikePairs(image, wholes, longest_radii, look_for_stick, work)) {
    const WholeMarker &a = wholes[pair.first], &b = wholes[pair.last];
    if (!rays[pair.first] || !rays[pair.last]) continue;
    const MarkerSight sight_a = SightOf(a.blob, *rays[pair.first]);
    const MarkerSight sight_b = SightOf(b.blob, *rays[pair.last]);
    for (const Layout& layout : kLayouts) {
      search.Try(a, b, pair.first, pair.last, sight_a, sight_b, layout, pair);
      search.Try(b, a, pair.last, pair.first, sight_b, sight_a, layout, pair);
    }
  }
  *work -= most_third_work - third_work;
  for (auto* candidates : {&found.candidates, &found.thirds}) {
    std::ranges::sort(*candidates, [](const WandCandidate& a, const WandCandidate& b) {
      return std::tie(a.cost, a.blobs) < std::tie(b.cost, b.blobs);
    });
  }
  if (found.candidates.size() > max_candidates) found.candidates.resize(max_candidates);
  return found;
}

}  // namespace rigcal::agent
