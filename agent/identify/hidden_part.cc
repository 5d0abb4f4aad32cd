// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/hidden_part.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "agent/detect/blobs/disc_pair.h"
#include "agent/identify/ring_background.h"
#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

// Of a pixel that looks like them.
constexpr float kDarkest = 0.6f, kBrightest = 1.5f, kColour = 0.13f;
constexpr double kGapPx = 1.2, kGapRadii = 0.08, kLeastRingPx = 2, kRingRadii = 0.3;
constexpr double kFinePartPx = 5;      // larger ones are read more coarsely
constexpr double kWorkOfPixel = 0.08;  // against one that is measured
// Of a part, against the whole marker.
constexpr double kLeastShare = 0.07, kLeastSolid = 1, kLeastSolidShare = 0.02, kMostAround = 0.17,
                 kInImage = 0.05, kMostOther = 0.1, kOtherShare = 0.35;
// Where it is as bright all around, as before a window, some of that is seen past the marker.
constexpr double kPastMarker = 0.5;
// Less than half of a disc that a straight edge leaves is longer than wide by 0.89 at least, that a
// corner leaves, by 0.37.
constexpr double kMostOfSmall = 0.5, kRoundElongation = 0.22;
constexpr int kLeastRoundPx = 20;
// Of a circular segment that is so much of the disc, the centroid is 1 - share^p radii away from
// the disc's centre, within 0.02.
constexpr double kSegmentPower = 0.74;
constexpr double kAroundSigma = 0.08, kSmallShare = 0.3, kSmallCost = 1.5;
// Of a sliver, blurred with what is around: as shares of the way from there to a whole marker.
constexpr double kLeastSliverContrast = 50;  // grey levels, of a marker
constexpr double kLeastCover = 0.12, kCoverSigmas = 4, kBusyCover = 0.15;
constexpr double kCoverColour = 0.3;  // of the cover, across the way
constexpr int kLeastSliverPixels = 3;
constexpr double kLeastSliverPx = 1, kLeastWithStickPx = 0.7, kLeastSliverShare = 0.015,
                 kSliverCost = 1.5;

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

}  // namespace

bool IsSmallThing(double share, const Blob& blob) {
  if (share > kMostOfSmall || blob.area_px < kLeastRoundPx) return false;
  return Elongation(blob) < kRoundElongation;
}

Eigen::Vector2d MiddleBeyondBorder(const ImageView& image, const Blob& part,
                                   const Eigen::Vector2d& disc_px, double radius_px) {
  const auto beyond = [radius_px](double at, int size) {
    return at + radius_px > size - 0.5 ? 1.0 : at - radius_px < -0.5 ? -1.0 : 0.0;
  };
  const Eigen::Vector2d outwards(beyond(disc_px.x(), image.width),
                                 beyond(disc_px.y(), image.height));
  if (outwards.isZero()) return part.centre_px;
  const double share = part.area_px / (std::numbers::pi * radius_px * radius_px);
  const double away_radii = 1 - std::pow(std::min(1.0, share), kSegmentPower);
  return part.centre_px + away_radii * radius_px * outwards.normalized();
}

std::optional<HiddenPart> LookForPart(const ImageView& image, const Eigen::Vector2d& centre_px,
                                      double radius_px, const Eigen::Vector3f& core, bool has_stick,
                                      double* work) {
  const double from = radius_px + kGapPx + kGapRadii * radius_px;
  const double to = from + std::max(kLeastRingPx, kRingRadii * radius_px);
  const int step = std::clamp(static_cast<int>(radius_px / kFinePartPx), 1, 4);
  const auto low = [](double at, double reach) {
    return std::max(0, static_cast<int>(std::ceil(at - reach)));
  };
  const auto high = [](double at, double reach, int size) {
    return std::min(size - 1, static_cast<int>(std::floor(at + reach)));
  };
  const float brightness = core.norm();
  const Eigen::Vector3f colour = core / brightness;
  const auto least_squared = static_cast<int>(kDarkest * kDarkest * brightness * brightness);
  const auto most_squared =
      static_cast<int>(std::ceil(kBrightest * kBrightest * brightness * brightness));
  constexpr float kCosine = 1 - 0.5f * kColour * kColour;
  int brighter = 0, read = 0;
  bool as_bright = false;  // the last pixel, whatever its colour
  const auto is_alike = [&](int x, int y) {
    ++read;
    const int squared = SquaredGreyAt(image, x, y);
    as_bright = squared > least_squared;
    if (!as_bright) return false;
    if (squared >= most_squared) {
      ++brighter;
      return false;
    }
    const float along = GreyAt(image, x, y).dot(colour);
    return along > 0 && along * along > kCosine * kCosine * static_cast<float>(squared);
  };
  const auto neighbours_alike = [&](int x, int y) {
    if (x == 0 || y == 0 || x + 1 == image.width || y + 1 == image.height) return 0;
    return int{is_alike(x - 1, y)} + int{is_alike(x + 1, y)} + int{is_alike(x, y - 1)} +
           int{is_alike(x, y + 1)};
  };
  const auto is_inside = [&](int x, int y) {
    return Squared(x - centre_px.x()) + Squared(y - centre_px.y()) <= radius_px * radius_px;
  };
  // Mostly nothing is there. Of a pixel and its neighbours some lie on a chequered pattern.
  const auto has_any = [&] {
    if (step > 1) return true;
    const int first = low(centre_px.x(), radius_px);
    const int bottom = high(centre_px.y(), radius_px, image.height);
    for (int y = low(centre_px.y(), radius_px); y <= bottom; ++y) {
      const double half = std::sqrt(
          std::max(0.0, radius_px * radius_px - Squared(static_cast<double>(y) - centre_px.y())));
      const int left = low(centre_px.x(), half), end = high(centre_px.x(), half, image.width);
      for (int x = left + ((left ^ first ^ y) & 1); x <= end; x += 2) {
        if (is_alike(x, y)) return true;
      }
    }
    return false;
  };
  const bool any = has_any();
  *work -= kWorkOfPixel * read;
  if (!any) return std::nullopt;
  brighter = read = 0;
  // Calls `look` for what is nearer than `reach`.
  const auto for_each = [&](double reach, const auto& look) {
    const int right = high(centre_px.x(), reach, image.width);
    const int bottom = high(centre_px.y(), reach, image.height);
    for (int y = low(centre_px.y(), reach); y <= bottom; y += step) {
      for (int x = low(centre_px.x(), reach); x <= right; x += step) look(x, y);
    }
  };
  int disc = 0, solid = 0, nearly_solid = 0, other = 0;
  ComponentSums sums;
  for_each(radius_px, [&](int x, int y) {
    if (!is_inside(x, y)) return;
    ++disc;
    const bool alike = is_alike(x, y);
    if (as_bright && !alike) ++other;
    if (!alike) return;
    const int neighbours = neighbours_alike(x, y);
    solid += neighbours == 4 ? 1 : 0;
    nearly_solid += neighbours >= 3 ? 1 : 0;
    Count(x, y, &sums);
  });
  *work -= kWorkOfPixel * read;
  read = 0;
  const double pixels = std::numbers::pi * radius_px * radius_px / (step * step);
  if (disc < kInImage * pixels) return std::nullopt;
  HiddenPart part;
  part.share = static_cast<double>(sums.area) / disc;
  const double least_solid = std::max(kLeastSolid, kLeastSolidShare * disc);
  if (part.share < kLeastShare || nearly_solid < least_solid) return std::nullopt;
  int ring = 0, around = 0, other_around = 0;
  for_each(to, [&](int x, int y) {
    const double squared = Squared(x - centre_px.x()) + Squared(y - centre_px.y());
    if (squared < from * from || squared > to * to) return;
    ++ring;
    const bool alike = is_alike(x, y);
    around += alike ? 1 : 0;
    other_around += as_bright && !alike ? 1 : 0;
  });
  *work -= kWorkOfPixel * read;
  if (ring == 0) return std::nullopt;
  // What hides a marker is hardly as bright as it is: that is a lamp or a label with a rim.
  const double past = kPastMarker * other_around / ring;
  if (other >
      std::max(std::max(kMostOther, past) * disc, kOtherShare * static_cast<double>(sums.area))) {
    return std::nullopt;
  }
  part.around = static_cast<double>(around) / ring;
  // The rim of something brighter has the others' colour by chance, but only a pixel wide.
  if (brighter > 0 && solid < least_solid && !has_stick) return std::nullopt;
  if (part.around > kMostAround) return std::nullopt;
  part.cost = Squared(part.around / kAroundSigma) +
              kSmallCost * std::max(0.0, 1 - part.share / kSmallShare);
  part.blob = ToBlob(sums, image);
  if (IsSmallThing(part.share, part.blob)) return std::nullopt;
  return part;
}

std::optional<HiddenPart> LookForSliver(const ImageView& image, const Eigen::Vector2d& centre_px,
                                        double radius_px, const Eigen::Vector3f& core,
                                        bool has_stick, double* work) {
  const double from = radius_px + kGapPx + kGapRadii * radius_px;
  const double to = from + std::max(kLeastRingPx, kRingRadii * radius_px);
  const int left = std::max(0, static_cast<int>(std::ceil(centre_px.x() - to)));
  const int right = std::min(image.width - 1, static_cast<int>(std::floor(centre_px.x() + to)));
  const int top = std::max(0, static_cast<int>(std::ceil(centre_px.y() - to)));
  const int bottom = std::min(image.height - 1, static_cast<int>(std::floor(centre_px.y() + to)));
  const auto squared = [&](int x, int y) {
    return Squared(x - centre_px.x()) + Squared(y - centre_px.y());
  };
  Eigen::Vector3f around = Eigen::Vector3f::Zero();
  Eigen::Matrix3f moments = Eigen::Matrix3f::Zero();
  int ring = 0;
  for (int y = top; y <= bottom; ++y) {
    for (int x = left + (y & 1); x <= right; x += 2) {
      if (squared(x, y) < from * from || squared(x, y) > to * to) continue;
      const Eigen::Vector3f grey = GreyAt(image, x, y);
      around += grey;
      moments += grey * grey.transpose();
      ++ring;
    }
  }
  *work -= kWorkOfPixel * ring;
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
    if (!(share >= least)) return 0.0;
    const double across = static_cast<double>((grey - along * unit).norm()) / length;
    return across < kCoverColour * share + sigma ? std::min(share, 1.0) : 0.0;
  };
  *work -= kWorkOfPixel * std::numbers::pi * radius_px * radius_px;
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
      area_px <
          std::max(has_stick ? kLeastWithStickPx : kLeastSliverPx, kLeastSliverShare * disc)) {
    return std::nullopt;
  }
  HiddenPart part;
  part.share = area_px / disc;
  part.is_sliver = true;
  part.cost = kSliverCost + kSmallCost * std::max(0.0, 1 - part.share / kSmallShare);
  part.blob = ToBlob(sums, image);
  if (IsSmallThing(part.share, part.blob)) return std::nullopt;
  return part;
}

}  // namespace rigcal::agent
