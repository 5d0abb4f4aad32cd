// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/partial_wands.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <tuple>

#include "agent/identify/ring_background.h"
#include "agent/identify/stick_sight.h"

namespace rigcal::agent {
namespace {

constexpr size_t kMarkers = 3;
constexpr double kPartSigma = 0.5;  // radii; the centre of a part is within the marker
constexpr double kWholePlacePx = 0.3, kWholePlaceShare = 0.03;
constexpr double kWholeRadiusPx = 0.35, kWholeRadiusShare = 0.08;
constexpr double kMaxPartialCost = 14;
// Of two whole markers.
constexpr size_t kMaxAlikePairs = 30;
constexpr double kPairBrightness = 0.3, kPairColour = 0.12, kMaxPairCost = 12;
constexpr double kLongest = 1.1, kSmallerPx = 0.5;  // than by radii; the mask leaves out the rim
constexpr double kMaxSizeCost = 9;
// Of the stick between them.
constexpr size_t kMostSticks = 150;  // pairs
constexpr double kWorkOfStick = 8, kStickSeen = 0.7, kStickGain = 3, kNoStickCost = 4;
constexpr double kOffSphere = 1.15, kOffSpherePx = 1.5;
constexpr double kInterrupted = 0.25, kCoveredCost = 3;  // where the middle one is covered
constexpr double kCommonRadiusPx = 0.8;                  // of both, by blur and the mask's limit
constexpr double kStepRadii = 0.25;  // along the line, between places that are looked at
constexpr int kSteps = 48;           // of the ratio of their depths
// Of a pixel that looks like them.
constexpr float kDarkest = 0.6f, kBrightest = 1.5f, kColour = 0.13f;
constexpr double kGapPx = 1.2, kGapRadii = 0.08, kLeastRingPx = 2, kRingRadii = 0.3;
constexpr double kFinePartPx = 5;      // larger ones are read more coarsely
constexpr double kWorkOfPixel = 0.25;  // against one that is measured
// Of a part, against the whole marker.
constexpr double kLeastShare = 0.07, kLeastSolid = 1, kLeastSolidShare = 0.02, kMostAround = 0.2,
                 kInImage = 0.25, kMostOther = 0.1, kOtherShare = 0.35;
constexpr double kAroundSigma = 0.08, kSmallShare = 0.3, kSmallCost = 1.5;
// Of a sliver, blurred with what is around: as shares of the way from there to a whole marker.
constexpr double kLeastSliverContrast = 50;  // grey levels, of a marker
constexpr double kLeastCover = 0.2, kCoverSigmas = 4, kBusyCover = 0.1;
constexpr double kCoverColour = 0.3;  // of the cover, across the way
constexpr int kLeastSliverPixels = 3;
constexpr double kLeastSliverPx = 1.5, kLeastSliverShare = 0.015, kSliverCost = 1.5;
constexpr double kSliverPairCost = 4;  // of two markers that are worth the look
constexpr double kLargestPart = 1.3, kKnownCost = 0.5;

double SquareOf(double x) { return x * x; }

double RadiusOf(const Blob& blob) { return std::sqrt(blob.area_px / std::numbers::pi); }

MarkerSight SightOf(const Blob& blob, const MarkerSight& ray) {
  MarkerSight sight = ray;
  sight.radius_px = RadiusOf(blob);
  sight.sigma_px = kWholePlacePx + kWholePlaceShare * sight.radius_px;
  sight.radius_sigma_px = kWholeRadiusPx + kWholeRadiusShare * sight.radius_px;
  return sight;
}

struct Pair {
  double cost;
  size_t first, last;
  bool has_stick = false;
};

double StickBetween(const ImageView& image, const Blob& a, const Blob& b) {
  const Eigen::Vector2d way = b.centre_px - a.centre_px;
  const double ra = RadiusOf(a), rb = RadiusOf(b), length = way.norm();
  const double begin = (kOffSphere * ra + kOffSpherePx) / length;
  const double end = 1 - (kOffSphere * rb + kOffSpherePx) / length;
  if (!(end > begin)) return 0;
  return StickShare(image, a.centre_px + begin * way, a.centre_px + end * way, 0.5 * (ra + rb));
}

// Those that are alike, the most alike first.
std::vector<Pair> AlikePairs(const ImageView& image, absl::Span<const WholeMarker> wholes,
                             double longest_radii, double* work) {
  std::vector<Pair> pairs;
  for (size_t i = 0; i < wholes.size(); ++i) {
    for (size_t j = i + 1; j < wholes.size(); ++j) {
      const WholeMarker &a = wholes[i], &b = wholes[j];
      const double ri = RadiusOf(a.blob), rj = RadiusOf(b.blob);
      if (ri > 1.6 * rj + 1 || rj > 1.6 * ri + 1) continue;
      const double apart_px = (a.blob.centre_px - b.blob.centre_px).norm();
      if (apart_px < ri + rj || apart_px > longest_radii * (0.5 * (ri + rj) + kSmallerPx)) continue;
      const float ga = std::max(1.0f, a.core.norm()), gb = std::max(1.0f, b.core.norm());
      const double cost =
          SquareOf(static_cast<double>(std::log(ga / gb)) / kPairBrightness) +
          static_cast<double>((a.core / ga - b.core / gb).squaredNorm()) / SquareOf(kPairColour) +
          a.doubt + b.doubt;
      if (cost <= kMaxPairCost) pairs.push_back({cost, i, j});
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) {
    return std::tie(a.cost, a.first, a.last) < std::tie(b.cost, b.first, b.last);
  });
  if (pairs.size() > kMostSticks) pairs.resize(kMostSticks);
  for (Pair& pair : pairs) {
    *work -= kWorkOfStick;
    pair.has_stick =
        StickBetween(image, wholes[pair.first].blob, wholes[pair.last].blob) >= kStickSeen;
    if (pair.has_stick) pair.cost = std::max(0.0, pair.cost - kStickGain);
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) {
    if (a.has_stick != b.has_stick) return a.has_stick;
    return std::tie(a.cost, a.first, a.last) < std::tie(b.cost, b.first, b.last);
  });
  if (pairs.size() > kMaxAlikePairs) pairs.resize(kMaxAlikePairs);
  return pairs;
}

// What is seen where a marker must be.
struct Part {
  double share = 0;   // of the marker's disc that looks like the others
  double around = 0;  // the same of a ring around it
  double cost = 0;
  Blob blob;
};

void Count(int x, int y, ComponentSums* sums) {
  sums->area += 1;
  sums->x += x;
  sums->y += y;
  sums->xx += int64_t{x} * x;
  sums->xy += int64_t{x} * y;
  sums->yy += int64_t{y} * y;
  sums->min_x = std::min(sums->min_x, x);
  sums->max_x = std::max(sums->max_x, x);
  sums->min_y = std::min(sums->min_y, y);
  sums->max_y = std::max(sums->max_y, y);
}

// None where nothing of the others' look is there, or more than a marker of it.
std::optional<Part> LookAt(const ImageView& image, const Eigen::Vector2d& centre_px,
                           double radius_px, const Eigen::Vector3f& core, double* work) {
  const double from = radius_px + kGapPx + kGapRadii * radius_px;
  const double to = from + std::max(kLeastRingPx, kRingRadii * radius_px);
  const int step = std::clamp(static_cast<int>(radius_px / kFinePartPx), 1, 4);
  const auto low = [&](double at) { return std::max(0, static_cast<int>(std::ceil(at - to))); };
  const auto high = [&](double at, int size) {
    return std::min(size - 1, static_cast<int>(std::floor(at + to)));
  };
  const float brightness = core.norm();
  const Eigen::Vector3f colour = core / brightness;
  int brighter = 0;
  bool as_bright = false;  // the last pixel, whatever its colour
  const auto is_alike = [&](int x, int y) {
    *work -= kWorkOfPixel;
    const Eigen::Vector3f grey = GreyAt(image, x, y);
    const float length = grey.norm();
    if (length >= kBrightest * brightness) ++brighter;
    as_bright = length > kDarkest * brightness;
    return length > kDarkest * brightness && length < kBrightest * brightness &&
           (grey / length - colour).squaredNorm() < kColour * kColour;
  };
  const auto neighbours_alike = [&](int x, int y) {
    if (x == 0 || y == 0 || x + 1 == image.width || y + 1 == image.height) return 0;
    return int{is_alike(x - 1, y)} + int{is_alike(x + 1, y)} + int{is_alike(x, y - 1)} +
           int{is_alike(x, y + 1)};
  };
  int disc = 0, ring = 0, around = 0, solid = 0, nearly_solid = 0, other = 0;
  ComponentSums sums;
  for (int y = low(centre_px.y()); y <= high(centre_px.y(), image.height); y += step) {
    for (int x = low(centre_px.x()); x <= high(centre_px.x(), image.width); x += step) {
      const double squared = SquareOf(x - centre_px.x()) + SquareOf(y - centre_px.y());
      const bool inside = squared <= radius_px * radius_px;
      if (!inside && (squared < from * from || squared > to * to)) continue;
      (inside ? disc : ring) += 1;
      const bool alike = is_alike(x, y);
      if (inside && as_bright && !alike) ++other;
      if (!alike) continue;
      if (!inside) {
        ++around;
        continue;
      }
      const int neighbours = neighbours_alike(x, y);
      solid += neighbours == 4 ? 1 : 0;
      nearly_solid += neighbours >= 3 ? 1 : 0;
      Count(x, y, &sums);
    }
  }
  const double pixels = std::numbers::pi * radius_px * radius_px / (step * step);
  if (disc < kInImage * pixels || ring == 0) return std::nullopt;
  Part part;
  part.share = static_cast<double>(sums.area) / disc;
  part.around = static_cast<double>(around) / ring;
  // The rim of something brighter has the others' colour by chance, but only a pixel wide.
  if (brighter == 0) solid = nearly_solid;
  // What hides a marker is hardly as bright as it is: that is a lamp or a label with a rim.
  if (other > std::max(kMostOther * disc, kOtherShare * static_cast<double>(sums.area))) {
    return std::nullopt;
  }
  if (part.share < kLeastShare || solid < std::max(kLeastSolid, kLeastSolidShare * disc) ||
      part.around > kMostAround) {
    return std::nullopt;
  }
  part.cost = SquareOf(part.around / kAroundSigma) +
              kSmallCost * std::max(0.0, 1 - part.share / kSmallShare);
  part.blob = ToBlob(sums, image);
  return part;
}

// A sliver is a pixel or two wide, so that each of its pixels is a mixture with what is around.
// None where nothing is mixed with the others' colour, or everything around differs as much.
std::optional<Part> LookForSliver(const ImageView& image, const Eigen::Vector2d& centre_px,
                                  double radius_px, const Eigen::Vector3f& core, double* work) {
  const double from = radius_px + kGapPx + kGapRadii * radius_px;
  const double to = from + std::max(kLeastRingPx, kRingRadii * radius_px);
  const int left = std::max(0, static_cast<int>(std::ceil(centre_px.x() - to)));
  const int right = std::min(image.width - 1, static_cast<int>(std::floor(centre_px.x() + to)));
  const int top = std::max(0, static_cast<int>(std::ceil(centre_px.y() - to)));
  const int bottom = std::min(image.height - 1, static_cast<int>(std::floor(centre_px.y() + to)));
  const auto squared = [&](int x, int y) {
    return SquareOf(x - centre_px.x()) + SquareOf(y - centre_px.y());
  };
  Eigen::Vector3f around = Eigen::Vector3f::Zero();
  Eigen::Matrix3f moments = Eigen::Matrix3f::Zero();
  int ring = 0;
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      if (squared(x, y) < from * from || squared(x, y) > to * to) continue;
      const Eigen::Vector3f grey = GreyAt(image, x, y);
      around += grey;
      moments += grey * grey.transpose();
      ++ring;
    }
  }
  *work -= kWorkOfPixel * (right - left + 1) * (bottom - top + 1);
  if (ring < 8) return std::nullopt;
  around /= static_cast<float>(ring);
  moments = moments / static_cast<float>(ring) - around * around.transpose();
  const Eigen::Vector3f way = core - around;
  const auto length = static_cast<double>(way.norm());
  if (length < kLeastSliverContrast) return std::nullopt;
  const Eigen::Vector3f unit = way / way.norm();
  const double sigma =
      std::sqrt(std::max(0.0, static_cast<double>(unit.dot(moments * unit)))) / length;
  if (sigma > kBusyCover) return std::nullopt;
  const double least = std::max(kLeastCover, kCoverSigmas * sigma);
  const auto cover = [&](int x, int y) {
    const Eigen::Vector3f grey = GreyAt(image, x, y) - around;
    const float along = grey.dot(unit);
    const auto share = static_cast<double>(along) / length;
    const double across = static_cast<double>((grey - along * unit).norm()) / length;
    return share >= least && across < kCoverColour * share + sigma ? std::min(share, 1.0) : 0.0;
  };
  ComponentSums sums;
  double area_px = 0;
  int disc = 0;
  for (int y = std::max(top, 1); y <= std::min(bottom, image.height - 2); ++y) {
    for (int x = std::max(left, 1); x <= std::min(right, image.width - 2); ++x) {
      if (squared(x, y) > radius_px * radius_px) continue;
      ++disc;
      const double share = cover(x, y);
      if (!(share > 0)) continue;
      // Noise is alone.
      if (!(cover(x - 1, y) + cover(x + 1, y) + cover(x, y - 1) + cover(x, y + 1) > 0)) continue;
      area_px += share;
      Count(x, y, &sums);
    }
  }
  if (disc == 0 || sums.area < kLeastSliverPixels ||
      area_px < std::max(kLeastSliverPx, kLeastSliverShare * disc)) {
    return std::nullopt;
  }
  Part part;
  part.share = area_px / disc;
  part.cost = kSliverCost + kSmallCost * std::max(0.0, 1 - part.share / kSmallShare);
  part.blob = ToBlob(sums, image);
  return part;
}

// Where a marker must be, if the other two are so far away.
struct Place {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  double radius_px = 0;
  double size_cost = 0;
};

// Two of the three markers, in the wand's order, and the one that is hidden.
struct Layout {
  size_t first, second, hidden;
};
constexpr Layout kLayouts[] = {{1, 2, 0}, {0, 2, 1}, {0, 1, 2}};

class PartSearch {
 public:
  PartSearch(const ImageView& image, const WandFinder& finder, absl::Span<const Blob> known_parts,
             double* work, PartialWands* found)
      : known_parts_(known_parts), image_(image), finder_(finder), work_(*work), found_(*found) {}

  // `a` and `b` are markers first and second.
  void Try(const WholeMarker& a, const WholeMarker& b, size_t index_a, size_t index_b,
           const MarkerSight& sight_a, const MarkerSight& sight_b, const Layout& layout,
           const Pair& pair) {
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
    std::optional<Part> best;
    std::optional<Place> place;
    const auto look = [&] {
      ++found_.tried;
      std::optional<Part> part = LookAt(image_, place->centre_px, place->radius_px, core, &work_);
      if (!part) part = KnownAt(place->centre_px, place->radius_px, a, b);
      if (!part && pair_cost < kSliverPairCost) {
        part = LookForSliver(image_, place->centre_px, place->radius_px, core, &work_);
      }
      if (!part && pair.has_stick && layout.hidden == 1) part = CoveredAt(*place, a.blob, b.blob);
      if (!part) return;
      part->cost += place->size_cost;
      if (pair.has_stick && layout.hidden != 1) {
        part->cost += kNoStickCost * (1 - StickTo(*place, layout.hidden == 0 ? a.blob : b.blob));
      }
      if (!best || part->cost < best->cost ||
          (part->cost == best->cost && part->share > best->share)) {
        best = part;
      }
    };
    Eigen::Vector2d begin_px = Eigen::Vector2d::Zero();
    for (int i = 0; i <= kSteps; ++i) {
      const double ratio = low * std::pow(high / low, static_cast<double>(i) / kSteps);
      const Eigen::Vector3d line = ratio * sight_b.ray - sight_a.ray;
      const double first_m = span_m / line.norm();
      const double size_cost = SizeCost(sight_a, sight_b, first_m, ratio * first_m);
      if (!(size_cost <= kMaxSizeCost)) continue;
      const Eigen::Vector3d hidden = sight_a.ray + at * line;
      Place next{.size_cost = size_cost};
      if (!(hidden.z() > 0) || !finder_.ImageOf(hidden, &next.centre_px)) continue;
      next.radius_px = 0.5 * (sight_a.radius_px + ratio * sight_b.radius_px) / hidden.norm();
      if (work_ <= 0) {
        found_.cut_short = true;
        found_.cut_stick |= pair.has_stick;
        return;
      }
      // Of places that are nearly the same the one that fits the sizes best.
      const bool moved = place && (next.centre_px - begin_px).norm() > kStepRadii * next.radius_px;
      if (moved) look();
      if (!place || moved) begin_px = next.centre_px;
      if (!place || moved || next.size_cost < place->size_cost) place = next;
    }
    if (place) look();
    if (!best) return;
    WandCandidate candidate;
    candidate.partial = static_cast<int>(layout.hidden);
    candidate.has_stick = pair.has_stick;
    candidate.blobs.resize(kMarkers);
    candidate.blobs[layout.first] = static_cast<int>(index_a);
    candidate.blobs[layout.second] = static_cast<int>(index_b);
    candidate.blobs[layout.hidden] = static_cast<int>(found_.blobs.size());
    absl::InlinedVector<MarkerSight, 4> sights(kMarkers);
    sights[layout.first] = sight_a;
    sights[layout.second] = sight_b;
    if (!finder_.Sight(best->blob.centre_px, &sights[layout.hidden])) return;
    LoosenSight(radius, &sights[layout.hidden]);
    if (!FitWand(sights, shares, finder_.length_m(), options, &candidate.fit) ||
        candidate.fit.cost > kMaxPartialCost) {
      return;
    }
    candidate.cost = candidate.fit.cost + pair_cost + best->cost;
    candidate.partial_cost = best->cost;
    candidate.partial_share = best->share;
    found_.blobs.push_back(best->blob);
    found_.candidates.push_back(candidate);
  }

 private:
  // A sliver is darker than a whole marker, but where little has the wand's colour it may be known.
  std::optional<Part> KnownAt(const Eigen::Vector2d& centre_px, double radius_px,
                              const WholeMarker& a, const WholeMarker& b) const {
    const double area_px = std::numbers::pi * radius_px * radius_px;
    for (const Blob& blob : known_parts_) {
      if ((blob.centre_px - centre_px).norm() > radius_px ||
          blob.area_px > kLargestPart * area_px ||
          (blob.centre_px - a.blob.centre_px).norm() < radius_px ||
          (blob.centre_px - b.blob.centre_px).norm() < radius_px) {
        continue;
      }
      return Part{.share = 0, .around = 0, .cost = kKnownCost, .blob = blob};
    }
    return std::nullopt;
  }

  // Where the stick is seen between the other two, it is seen from the nearer one to the third.
  double StickTo(const Place& place, const Blob& nearer) {
    work_ -= kWorkOfStick;
    const Eigen::Vector2d way = place.centre_px - nearer.centre_px;
    const double begin = (kOffSphere * RadiusOf(nearer) + kOffSpherePx) / way.norm();
    const double end = 1 - (kOffSphere * place.radius_px + kOffSpherePx) / way.norm();
    if (!(end > begin)) return 0.5;
    return StickShare(image_, nearer.centre_px + begin * way, nearer.centre_px + end * way,
                      place.radius_px);
  }

  // Something covers the stick where the marker must be, and where it would be the other way round
  // the stick is seen.
  std::optional<Part> CoveredAt(const Place& place, const Blob& a, const Blob& b) {
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
    Part part{.share = 0, .around = 0, .cost = kCoveredCost, .blob = Blob()};
    part.blob.centre_px = place.centre_px;
    part.blob.area_px = static_cast<int>(std::numbers::pi * SquareOf(place.radius_px));
    part.blob.second_moment_px2 = 0.25 * SquareOf(place.radius_px) * Eigen::Matrix2d::Identity();
    return part;
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
      const double variance = SquareOf(a.radius_sigma_px);
      return SquareOf(0.5 * (of_a + of_b)) / (SquareOf(kCommonRadiusPx) + 0.5 * variance) +
             SquareOf(of_a - of_b) / (2 * variance);
    }
    const double difference_px =
        a.radius_px - b.radius_px * second_m / first_m * a.scale_px / b.scale_px;
    return SquareOf(difference_px / (1.5 * a.radius_sigma_px));
  }

  absl::Span<const Blob> known_parts_;
  const ImageView& image_;
  const WandFinder& finder_;
  double& work_;
  PartialWands& found_;
};

}  // namespace

void LoosenSight(double radius_px, MarkerSight* sight) {
  sight->sigma_px = kPartSigma * radius_px + 0.5;
  sight->radius_px = radius_px;
  sight->radius_sigma_px = 10 * radius_px;
}

PartialWands FindPartialWands(const ImageView& image, const WandFinder& finder,
                              absl::Span<const WholeMarker> wholes,
                              absl::Span<const Blob> known_parts, size_t max_candidates,
                              double* work) {
  PartialWands found;
  if (finder.shares().size() != kMarkers) return found;
  for (const WholeMarker& whole : wholes) found.blobs.push_back(whole.blob);
  PartSearch search(image, finder, known_parts, work, &found);
  // Of a wand across the line of sight; no other one is longer in the image.
  const double diameter_m = finder.fit_options().diameter_m;
  const double longest_radii = diameter_m > 0 ? kLongest * 2 * finder.length_m() / diameter_m
                                              : std::numeric_limits<double>::infinity();
  for (const Pair& pair : AlikePairs(image, wholes, longest_radii, work)) {
    const WholeMarker &a = wholes[pair.first], &b = wholes[pair.last];
    MarkerSight ray_a, ray_b;
    if (!finder.Sight(a.blob.centre_px, &ray_a) || !finder.Sight(b.blob.centre_px, &ray_b)) {
      continue;
    }
    const MarkerSight sight_a = SightOf(a.blob, ray_a), sight_b = SightOf(b.blob, ray_b);
    for (const Layout& layout : kLayouts) {
      search.Try(a, b, pair.first, pair.last, sight_a, sight_b, layout, pair);
      search.Try(b, a, pair.last, pair.first, sight_b, sight_a, layout, pair);
    }
  }
  std::sort(found.candidates.begin(), found.candidates.end(),
            [](const WandCandidate& a, const WandCandidate& b) {
              return std::tie(a.cost, a.blobs) < std::tie(b.cost, b.blobs);
            });
  if (found.candidates.size() > max_candidates) found.candidates.resize(max_candidates);
  return found;
}

}  // namespace rigcal::agent
