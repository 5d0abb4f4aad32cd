// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/partial_wands.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <tuple>

#include "agent/identify/ring_background.h"

namespace rigcal::agent {
namespace {

constexpr size_t kMarkers = 3;
constexpr double kPartSigma = 0.5;  // radii; the centre of a part is within the marker
constexpr double kWholePlacePx = 0.3, kWholePlaceShare = 0.03;
constexpr double kWholeRadiusPx = 0.35, kWholeRadiusShare = 0.08;
constexpr double kMaxPartialCost = 14;
// Of two whole markers.
constexpr size_t kMaxPairs = 30;
constexpr double kPairBrightness = 0.3, kPairColour = 0.12, kMaxPairCost = 12;
constexpr double kMaxSizeCost = 9;
constexpr double kCommonRadiusPx = 0.8;  // of both, by blur and the mask's limit
constexpr double kStepRadii = 0.4;  // along the line, between places that are looked at
constexpr int kMaxSteps = 40;
// Of a pixel that looks like them.
constexpr float kDarkest = 0.6f, kBrightest = 1.5f, kColour = 0.13f;
constexpr double kGapPx = 1.2, kLeastRingPx = 2, kRingRadii = 0.3;
constexpr double kFullRadiusPx = 10;  // larger ones are read more coarsely
// Of a part, against the whole marker.
constexpr double kLeastShare = 0.07, kLeastSolidPx = 1, kLeastSolid = 0.02, kMostAround = 0.2, kInImage = 0.25;
constexpr double kAroundSigma = 0.08, kSmallShare = 0.3, kSmallCost = 3;

double Squared(double x) { return x * x; }

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
};

// Those that are alike, the most alike first.
std::vector<Pair> AlikePairs(absl::Span<const WholeMarker> wholes) {
  std::vector<Pair> pairs;
  for (size_t i = 0; i < wholes.size(); ++i) {
    for (size_t j = i + 1; j < wholes.size(); ++j) {
      const WholeMarker &a = wholes[i], &b = wholes[j];
      const double ri = RadiusOf(a.blob), rj = RadiusOf(b.blob);
      if (ri > 1.6 * rj + 1 || rj > 1.6 * ri + 1) continue;
      if ((a.blob.centre_px - b.blob.centre_px).norm() < ri + rj) continue;
      const float ga = std::max(1.0f, a.core.norm()), gb = std::max(1.0f, b.core.norm());
      const double cost =
          Squared(static_cast<double>(std::log(ga / gb)) / kPairBrightness) +
          static_cast<double>((a.core / ga - b.core / gb).squaredNorm()) / Squared(kPairColour) +
          a.doubt + b.doubt;
      if (cost <= kMaxPairCost) pairs.push_back({cost, i, j});
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) {
    return std::tie(a.cost, a.first, a.last) < std::tie(b.cost, b.first, b.last);
  });
  if (pairs.size() > kMaxPairs) pairs.resize(kMaxPairs);
  return pairs;
}

// What is seen where a marker must be.
struct Part {
  double share = 0;   // of the marker's disc that looks like the others
  double around = 0;  // the same of a ring around it
  double cost = 0;
  Blob blob;
};

class PartMeter {
 public:
  explicit PartMeter(const ImageView& image) : image_(image) {}

  // None where nothing of the others' look is there, or more than a marker of it.
  std::optional<Part> LookAt(const Eigen::Vector2d& centre_px, double radius_px,
                             const Eigen::Vector3f& core, double* work) {
    const double from = radius_px + kGapPx;
    const double to = from + std::max(kLeastRingPx, kRingRadii * radius_px);
    const int step = std::clamp(static_cast<int>(radius_px / kFullRadiusPx), 1, 4);
    const auto low = [&](double at) { return std::max(0, static_cast<int>(std::ceil(at - to))); };
    const auto high = [&](double at, int size) {
      return std::min(size - 1, static_cast<int>(std::floor(at + to)));
    };
    const int x0 = low(centre_px.x()), x1 = high(centre_px.x(), image_.width);
    const int y0 = low(centre_px.y()), y1 = high(centre_px.y(), image_.height);
    if (x0 > x1 || y0 > y1) return std::nullopt;
    const float brightness = core.norm();
    const Eigen::Vector3f colour = core / brightness;
    int disc = 0, ring = 0, around = 0, solid = 0;
    const auto width = static_cast<size_t>((x1 - x0) / step + 1);
    alike_.assign(3 * width, 0);  // of the last three rows, within the disc
    ComponentSums sums;
    for (int y = y0; y <= y1; y += step) {
      std::rotate(alike_.begin(), alike_.begin() + static_cast<ptrdiff_t>(width), alike_.end());
      uint8_t* const row = &alike_[2 * width];
      std::fill_n(row, width, uint8_t{0});
      for (int x = x0; x <= x1; x += step) {
        const double squared = Squared(x - centre_px.x()) + Squared(y - centre_px.y());
        const bool inside = squared <= radius_px * radius_px;
        if (!inside && (squared < from * from || squared > to * to)) continue;
        *work -= 1;
        const Eigen::Vector3f grey = GreyAt(image_, x, y);
        const float length = grey.norm();
        const bool alike = length > kDarkest * brightness && length < kBrightest * brightness &&
                           (grey / length - colour).squaredNorm() < kColour * kColour;
        (inside ? disc : ring) += 1;
        if (!alike) continue;
        if (!inside) {
          ++around;
          continue;
        }
        row[static_cast<size_t>((x - x0) / step)] = 1;
        Count(x, y, &sums);
      }
      // Of the row before: with all four neighbours.
      for (size_t i = 1; i + 1 < width; ++i) {
        const uint8_t* const middle = &alike_[width + i];
        solid += middle[0] & middle[-1] & middle[1] & alike_[i] & row[i];
      }
    }
    const double pixels = std::numbers::pi * radius_px * radius_px / (step * step);
    if (disc < kInImage * pixels || ring == 0) return std::nullopt;
    Part part;
    part.share = static_cast<double>(sums.area) / disc;
    part.around = static_cast<double>(around) / ring;
    // The rim of something else has the others' colour by chance, but only a pixel wide.
    if (part.share < kLeastShare || solid < std::max(kLeastSolidPx, kLeastSolid * disc) ||
        part.around > kMostAround) {
      return std::nullopt;
    }
    part.cost = Squared(part.around / kAroundSigma) +
                kSmallCost * std::max(0.0, 1 - part.share / kSmallShare);
    part.blob = ToBlob(sums, image_);
    return part;
  }

 private:
  static void Count(int x, int y, ComponentSums* sums) {
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

  const ImageView& image_;
  std::vector<uint8_t> alike_;
};

// Two of the three markers, in the wand's order, and the one that is hidden.
struct Layout {
  size_t first, second, hidden;
};
constexpr Layout kLayouts[] = {{1, 2, 0}, {0, 2, 1}, {0, 1, 2}};

class PartSearch {
 public:
  PartSearch(const ImageView& image, const WandFinder& finder, double* work, PartialWands* found)
      : meter_(image), finder_(finder), work_(*work), found_(*found) {}

  // `a` and `b` are markers first and second.
  void Try(const WholeMarker& a, const WholeMarker& b, size_t index_a, size_t index_b,
           const MarkerSight& sight_a, const MarkerSight& sight_b, const Layout& layout,
           double pair_cost) {
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
    const double length_px = (a.blob.centre_px - b.blob.centre_px).norm();
    const double radius = 0.5 * (sight_a.radius_px + sight_b.radius_px);
    // A step moves the place by at * (1 - at) of it, relative to the two's distance.
    const double lever = std::abs(at * (1 - at)) * length_px;
    const int steps = std::clamp(
        static_cast<int>(std::ceil(std::log(high / low) * lever / (kStepRadii * radius))), 2,
        kMaxSteps);
    std::optional<Part> best;
    for (int i = 0; i <= steps; ++i) {
      const double ratio = low * std::pow(high / low, static_cast<double>(i) / steps);
      const Eigen::Vector3d line = ratio * sight_b.ray - sight_a.ray;
      const double first_m = span_m / line.norm();
      const double size_cost = SizeCost(sight_a, sight_b, first_m, ratio * first_m);
      if (!(size_cost <= kMaxSizeCost)) continue;
      const Eigen::Vector3d hidden = sight_a.ray + at * line;
      Eigen::Vector2d pixel;
      if (!(hidden.z() > 0) || !finder_.ImageOf(hidden, &pixel)) continue;
      const double its_radius =
          0.5 * (sight_a.radius_px + ratio * sight_b.radius_px) / hidden.norm();
      if (work_ <= 0) {
        found_.cut_short = true;
        return;
      }
      ++found_.tried;
      std::optional<Part> part = meter_.LookAt(pixel, its_radius, core, &work_);
      if (!part) continue;
      part->cost += size_cost;
      if (!best || part->cost < best->cost ||
          (part->cost == best->cost && part->share > best->share)) {
        best = part;
      }
    }
    if (!best) return;
    WandCandidate candidate;
    candidate.partial = static_cast<int>(layout.hidden);
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
    found_.blobs.push_back(best->blob);
    found_.candidates.push_back(candidate);
  }

 private:
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

  PartMeter meter_;
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
                              absl::Span<const WholeMarker> wholes, size_t max_candidates,
                              double* work) {
  PartialWands found;
  if (finder.shares().size() != kMarkers) return found;
  for (const WholeMarker& whole : wholes) found.blobs.push_back(whole.blob);
  PartSearch search(image, finder, work, &found);
  for (const Pair& pair : AlikePairs(wholes)) {
    const WholeMarker &a = wholes[pair.first], &b = wholes[pair.last];
    MarkerSight ray_a, ray_b;
    if (!finder.Sight(a.blob.centre_px, &ray_a) || !finder.Sight(b.blob.centre_px, &ray_b)) {
      continue;
    }
    const MarkerSight sight_a = SightOf(a.blob, ray_a), sight_b = SightOf(b.blob, ray_b);
    for (const Layout& layout : kLayouts) {
      search.Try(a, b, pair.first, pair.last, sight_a, sight_b, layout, pair.cost);
      search.Try(b, a, pair.last, pair.first, sight_b, sight_a, layout, pair.cost);
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
