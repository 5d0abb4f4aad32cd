// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/outlined_centres.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

namespace rigcal::agent {
namespace {

constexpr double kLeastScatter = 0.3;
constexpr double kShadingError = 0.012;         // radii, per relative slope of the light
constexpr double kCentroidShadingError = 0.25;  // the same of a centroid
constexpr double kHiddenError = 1;              // radii, per share of the edge that is elsewhere
constexpr double kLeastGapPx = 1;
constexpr double kOwnScatter = 1.8, kFollowed = 9;  // of a sphere, against the wand's
constexpr double kShaded = 8;  // slope_chi_squared of a sphere that is lit from one side
constexpr double kUnknownSlope =
    0.5;  // of the slopes' variance by noise, over the root of their number
constexpr double kLeastSlope = 0.005;
constexpr double kEvenLight = 4;  // slope_chi_squared
constexpr double kWhiteGain = 4;   // half a chi-squared

using FittedOutlines = absl::InlinedVector<std::optional<SphereOutline>, 3>;

double ToSquare(double x) { return x * x; }

// Another marker of the wand is so near that blur joins them.
bool IsCrowded(const VerifiedWand& wand, size_t marker, double edge_px) {
  const MarkerCentre& own = wand.centres[marker];
  for (size_t k = 0; k < wand.centres.size(); ++k) {
    const MarkerCentre& other = wand.centres[k];
    const double gap_px =
        (own.centre_px - other.centre_px).norm() - own.radius_px - other.radius_px;
    if (k != marker && gap_px < kLeastGapPx + 4 * edge_px) return true;
  }
  return false;
}

double ScatterOf(const SphereOutline& outline) { return std::max(1.0, ToSquare(outline.residual)); }

// One sigma of the relative slopes of the light on the wand's spheres.
double SlopeSigma(const FittedOutlines& fitted) {
  double squares = 0, noise = 0;
  int count = 0;
  for (const auto& outline : fitted) {
    if (!outline) continue;
    squares += 0.5 * outline->slope.squaredNorm();
    noise += 0.5 * ScatterOf(*outline) * outline->slope_covariance.trace();
    ++count;
  }
  if (count == 0) return kLeastSlope;
  const double variance =
      std::max(0.0, (squares - noise) / count) + kUnknownSlope * noise / std::pow(count, 1.5);
  return std::clamp(std::sqrt(variance), kLeastSlope, SphereShading::kAnySlope);
}

// The outlines with the kind of light, the same on all spheres, that fits better.
FittedOutlines WithTheirLight(const OutlinedMarkers& markers, const VerifiedWand& wand,
                              SphereOutlineFitter* fitter, SphereShading* light) {
  FittedOutlines own(markers.size()), white(markers.size());
  double gained = 0;
  for (size_t k = 0; k < markers.size(); ++k) {
    if (markers[k].outline == nullptr) continue;
    own[k] = white[k] = *markers[k].outline;
    // Even light, as in a dark room, needs no other model.
    if (own[k]->slope_chi_squared < kEvenLight * ScatterOf(*own[k])) continue;
    if (!fitter->Fit(*markers[k].pixels, wand.centres[k].second_moment_px2, {.white = true},
                     &*white[k])) {
      white[k] = own[k];
      continue;
    }
    gained += (own[k]->cost - white[k]->cost) / ScatterOf(*own[k]);
  }
  light->white = gained > kWhiteGain;
  return light->white ? white : own;
}

}  // namespace

void SetOutlinedCentres(const OutlinedMarkers& markers, SphereOutlineFitter* fitter,
                        VerifiedWand* wand) {
  SphereShading light;
  const FittedOutlines fitted = WithTheirLight(markers, *wand, fitter, &light);
  double chi_squared = 0;
  int count = 0;
  for (const auto& outline : fitted) {
    if (!outline) continue;
    chi_squared += outline->slope_chi_squared / ScatterOf(*outline);
    ++count;
  }
  const bool shaded = chi_squared >= kShaded * count;
  const double slope_sigma = SlopeSigma(fitted);
  FittedOutlines outlines(markers.size());
  // All spheres of a wand have the same mosaic, compression and blur.
  double scatter = 0, freedom = 0;
  for (size_t k = 0; k < markers.size(); ++k) {
    if (!fitted[k]) continue;
    // Its light reaches the outline, but not the centroid, of which both sides are cut.
    if (IsCrowded(*wand, k, fitted[k]->edge_px) ||
        (!shaded && !wand->outlined[k] && wand->centres[k].has_neighbour)) {
      continue;
    }
    SphereOutline outline = *fitted[k];
    // The prior is not noise, which the scatter scales.
    light.slope_sigma = slope_sigma / std::sqrt(ScatterOf(outline));
    if (!outline.white &&
        !fitter->Fit(*markers[k].pixels, wand->centres[k].second_moment_px2, light, &outline)) {
      continue;
    }
    outlines[k] = outline;
    scatter += outline.edge_chi_squared;
    freedom += outline.edge_freedom;
  }
  const double factor = std::max(kLeastScatter, freedom > 0 ? scatter / freedom : 1);
  for (size_t k = 0; k < markers.size(); ++k) {
    if (!wand->whole[k]) continue;
    MarkerCentre& centre = wand->centres[k];
    if (outlines[k]) {
      centre.centre_px = outlines[k]->centre_px;
      // One that is worse than the others by more than chance has something of its own, which the
      // fit has half followed.
      const SphereOutline& own = *outlines[k];
      const double others = std::max(
          kLeastScatter, freedom > own.edge_freedom + 1
                             ? (scatter - own.edge_chi_squared) / (freedom - own.edge_freedom)
                             : factor);
      const double excess =
          own.edge_chi_squared / std::max(1.0, own.edge_freedom) / others - kOwnScatter;
      centre.covariance_px2 =
          (excess > 0 ? others * (kOwnScatter + kFollowed * excess) : factor) * own.covariance_px2;
    }
    if (!fitted[k]) continue;
    const SphereOutline& outline = *fitted[k];
    double wrong_px = kHiddenError * outline.off_outline * outline.radius_px;
    // Light from one side is not quite a polynomial, and moves a centroid.
    const double slope = std::min(slope_sigma * std::sqrt(2.0), outline.slope.norm());
    wrong_px = std::hypot(wrong_px, (outlines[k] ? kShadingError : kCentroidShadingError) * slope *
                                        outline.radius_px);
    centre.covariance_px2 += wrong_px * wrong_px * Eigen::Matrix2d::Identity();
  }
}

}  // namespace rigcal::agent
