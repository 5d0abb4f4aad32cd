// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/outline_sectors.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace rigcal::agent {
namespace {

constexpr double kFittedShare = 11.0 / 16;  // place, radius and shape take five sectors
constexpr double kLeastNoise = 0.1;         // least EdgeScatter::noise
constexpr double kPixelSectors = 32;        // an outline's pixels count as so many sectors
constexpr double kPriorSectors = 8;         // all outlines count as so many own sectors
// One sigma of the edge at the stick. The spheres light the stick, which makes them longer by some
// hundredths of a pixel, the outer ones on one side only. This bias would scale the rig, so the
// stick's sides do not count. An arc has little else, so there they do.
constexpr double kStickPx = 100, kStickOfArcPx = 0.2;
constexpr double kMostUsual = 5;  // times the usual square, as which a sector counts at most
constexpr double kTooFar = 4;     // squared sigmas; a sector further away gets its own variance
// What disturbs a sector disturbs its neighbours too, so it moves the place by more.
constexpr double kShared = 3;
constexpr double kSaturatedPx = 0.3;    // one sigma of an edge before a saturated background
constexpr double kLeastOfSector = 0.2;  // of the mean information; sectors with less say nothing

double MeanInformation(const SphereOutline& outline) {
  double sum = 0;
  for (const double one : outline.sector_information) sum += one;
  return sum / kOutlineSectors;
}

// Squared distances of the edge from the outline, and their variances by noise, px^2.
struct SectorErrors {
  std::vector<double> squared, variance;
};

void AddErrors(const SphereOutline& outline, SectorErrors* errors) {
  const double least = kLeastOfSector * MeanInformation(outline);
  for (size_t s = 0; s < kOutlineSectors; ++s) {
    const double information = outline.sector_information[s];
    if (!(information > least)) continue;
    const double away = outline.sector_score[s] / information;
    errors->squared.push_back(away * away / kFittedShare);
    errors->variance.push_back(1 / information);
  }
}

// Mean excess of the squares over `noise` times the variances; a few large squares count less.
double Excess(const SectorErrors& errors, double noise) {
  if (errors.squared.empty()) return 0;
  std::vector<double> sorted = errors.squared;
  std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
  const double most = kMostUsual * sorted[sorted.size() / 2] / 0.455;  // median of a chi-squared
  double sum = 0;
  for (size_t i = 0; i < errors.squared.size(); ++i) {
    sum += std::min(errors.squared[i], most) - noise * errors.variance[i];
  }
  return sum / static_cast<double>(errors.squared.size());
}

}  // namespace

std::vector<EdgeScatter> ScatterOfEdges(absl::Span<const SphereOutline* const> outlines) {
  SectorErrors all;
  for (const SphereOutline* outline : outlines) {
    if (outline != nullptr) AddErrors(*outline, &all);
  }
  auto count_of_all = static_cast<double>(all.squared.size());
  double ratios = 0;
  for (size_t i = 0; i < all.squared.size(); ++i) ratios += all.squared[i] / all.variance[i];
  // Sectors are few, pixels many: the scatter of the pixels counts too.
  for (const SphereOutline* outline : outlines) {
    if (outline == nullptr) continue;
    ratios += kPixelSectors * outline->pixel_noise;
    count_of_all += kPixelSectors;
  }
  EdgeScatter usual;
  usual.noise = std::clamp(ratios / std::max(1.0, count_of_all), kLeastNoise, 1.0);
  usual.extra_px2 = Excess(all, usual.noise);
  std::vector<EdgeScatter> scatters;
  for (const SphereOutline* outline : outlines) {
    EdgeScatter& own = scatters.emplace_back(usual);
    if (outline == nullptr) continue;
    SectorErrors errors;
    AddErrors(*outline, &errors);
    const auto count = static_cast<double>(errors.squared.size());
    double variances = 0;
    for (const double variance : errors.variance) variances += variance / std::max(1.0, count);
    // One sigma of the excess by noise alone. Up to that counts as none, twice that in full.
    const double chance_px2 = usual.noise * variances * std::sqrt(2 / (kPriorSectors + count));
    const double found_px2 =
        (kPriorSectors * std::max(0.0, usual.extra_px2) + count * Excess(errors, usual.noise)) /
        (kPriorSectors + count);
    own.extra_px2 = std::max(0.0, std::min(found_px2, 2 * (found_px2 - chance_px2)));
  }
  return scatters;
}

SectorVariances ExtraVariances(const OutlinePixels& pixels, const SphereOutline& outline,
                               const EdgeScatter& scatter, bool is_arc) {
  SectorVariances extra;
  extra.fill(kShared * scatter.extra_px2);
  for (size_t s = kOutlineSectors; s < kOutlineParts; ++s) {
    extra[s] = is_arc ? kStickOfArcPx * kStickOfArcPx : kStickPx * kStickPx;
  }
  std::array<double, kOutlineParts> saturated{}, count{};
  for (size_t i = 0; i < pixels.size(); ++i) {
    const size_t s = OutlinePart(pixels, i, outline.centre_px);
    saturated[s] += static_cast<double>(pixels.saturated_behind[i]);
    count[s] += 1;
  }
  for (size_t s = 0; s < kOutlineParts; ++s) {
    const double information = outline.sector_information[s];
    if (information > 0) {
      const double away = outline.sector_score[s] / information;
      const double squared = away * away / kFittedShare;
      if (squared > kTooFar * scatter.Of(information)) extra[s] = std::max(extra[s], squared);
    }
    if (saturated[s] > 0) {
      const double px = kSaturatedPx * saturated[s] / count[s];
      extra[s] = std::max(extra[s], px * px);
    }
  }
  return extra;
}

void Discount(const OutlinePixels& pixels, const SphereOutline& outline,
              const SectorVariances& extra_px2, double noise, OutlinePixels* discounted) {
  *discounted = pixels;
  std::array<float, kOutlineParts> factor;
  for (size_t s = 0; s < kOutlineParts; ++s) {
    factor[s] =
        static_cast<float>(1 / std::sqrt(1 + outline.sector_information[s] * extra_px2[s] / noise));
  }
  for (size_t i = 0; i < pixels.size(); ++i) {
    discounted->precision[i] *= factor[OutlinePart(pixels, i, outline.centre_px)];
  }
}

}  // namespace rigcal::agent
