// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/outlined_centres.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "agent/identify/outline_sectors.h"
#include "agent/identify/squared.h"
#include "agent/identify/visible_arc.h"
#include "agent/identify/wand_stick.h"

namespace rigcal::agent {
namespace {

// Widths of the edge, per relative slope of the light: blur hides how light changes near the rim.
constexpr double kShadingError = 0.07;
// The same along the light: of Lambert's law, and of a polynomial in its place.
constexpr double kWhiteError = 0.02, kNoWhiteError = 0.3, kAcrossWhiteError = 0.01;
constexpr double kCentroidShadingError = 0.25;  // the same of a centroid
// The same of light that is clipped, whose slope is not seen: where it is brighter, the edge at
// half of the clipped light is further out.
constexpr double kClippedError = 0.08;
constexpr double kHiddenError = 0.5;  // radii, per share of the edge that is elsewhere
constexpr double kLeastGapPx = 1;
constexpr double kLikeRadiusPx = 0.03, kLikeRadiusShare = 0.008;  // of one that is expected
constexpr double kEdgePx2 = 0.05, kEdgeShare = 0.15;
// A sphere that is smaller than the others say and whose edge is that much less on its outline is
// partly hidden.
constexpr double kPlacePerEdge = 2.5 * 2 / kOutlineSectors;  // variances, of all sectors
constexpr double kBackgroundPx = 0.3;  // of the edge, per step of the background over the contrast
constexpr double kNeighbourPx = 0.05;  // of the edge, where something else is near
constexpr double kHiddenPx = 0.1, kHiddenRatio = 6, kSuspectRatio = 3;
constexpr double kShortPx = 0.2;  // against what diameter and distance say
constexpr double kMostSaturatedBehind = 0.1;
// Signs of an outline of something else, over the place: of what it is smaller than the pose says,
// and of the radius, per relative slope of the light beyond one.
constexpr double kSmallError = 0.5, kDarkError = 0.1;
// The same of one that is longer than the others', over the place: per radius and stretch.
constexpr double kStretchError = 2, kLikeStretch = 0.04;
// Of arcs: of the radius by pose and diameter; sectors; of what leaving them out moves the centre.
constexpr double kPoseRadiusPx = 0.15, kPoseRadiusShare = 0.05;
constexpr double kOtherRadiusPx = 0.1, kOtherRadiusShare = 0.03;  // by another outline
constexpr int kLeastKnown = 6;     // sectors, of which the stick takes some
constexpr double kCutRatio = 100;  // less sure than any other
constexpr double kMovedError = 0.15;
constexpr double kArcError = 0.1, kAloneError = 0.2;   // radii
constexpr int kNotch = 2;                              // sectors that the stick takes
constexpr double kOddPx = 0.04, kOddError = 1;         // of the place, per error of the radius
constexpr double kSofterPx = 0.1, kSofterError = 0.4;  // the same of the edge's softness
constexpr double kLikeStretchSigma = 0.02, kLeastRatio = 0.5;
constexpr double kShaded = 8;  // slope_chi_squared of a sphere that is lit from one side
constexpr double kUnknownSlope =
    0.5;  // of the slopes' variance by noise, over the root of their number
constexpr double kLeastSlope = 0.005;
constexpr double kEvenLight = 4;  // slope_chi_squared
constexpr double kWhiteGain = 4;  // half a chi-squared

using FittedOutlines = absl::InlinedVector<std::optional<SphereOutline>, 3>;

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

double ScatterOf(const SphereOutline& outline) { return std::max(1.0, Squared(outline.residual)); }

// One sigma of the relative slopes of the light on the wand's spheres, of all light or of their
// own.
double SlopeSigma(const FittedOutlines& fitted, bool own) {
  double squares = 0, noise = 0;
  int count = 0;
  for (const auto& outline : fitted) {
    if (!outline) continue;
    squares += 0.5 * (own ? outline->own_slope : outline->slope).squaredNorm();
    noise += 0.5 * ScatterOf(*outline) *
             (own ? outline->own_slope_covariance : outline->slope_covariance).trace();
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

std::vector<EdgeScatter> ScatterOf(const FittedOutlines& outlines) {
  std::vector<const SphereOutline*> all;
  for (const auto& outline : outlines) all.push_back(outline ? &*outline : nullptr);
  return ScatterOfEdges(all);
}

double MedianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

// The spheres are of one size and equally out of focus: with their distances the middle one of
// three says how large each outline is and how soft. What hides a part of a sphere makes it
// smaller, what is beside it larger and softer.
OutlineExpectation ExpectationOf(const VerifiedWand& wand, const FittedOutlines& outlines,
                                 size_t marker) {
  OutlineExpectation expected;
  if (wand.px_per_m.size() != outlines.size()) return expected;
  std::vector<double> sizes_m, edges_px2, stretches_x, stretches_y;
  for (size_t k = 0; k < outlines.size(); ++k) {
    if (!outlines[k]) continue;
    sizes_m.push_back(outlines[k]->radius_px / wand.px_per_m[k]);
    edges_px2.push_back(Squared(outlines[k]->edge_px));
    stretches_x.push_back(outlines[k]->stretch.x());
    stretches_y.push_back(outlines[k]->stretch.y());
  }
  if (sizes_m.size() < 2) return expected;
  const double own_m = outlines[marker]->radius_px / wand.px_per_m[marker];
  const double size_m = MedianOf(sizes_m);
  double spread_m = 0;  // of two none is the middle one
  if (sizes_m.size() == 2) spread_m = std::abs(own_m - size_m);
  expected.radius_px = size_m * wand.px_per_m[marker];
  expected.radius_sigma_px =
      kLikeRadiusPx + kLikeRadiusShare * expected.radius_px + 2 * spread_m * wand.px_per_m[marker];
  if (sizes_m.size() > 2) {
    expected.edge_px2 = MedianOf(edges_px2);
    expected.edge_sigma_px2 = kEdgePx2 + kEdgeShare * expected.edge_px2;
    expected.stretch = {MedianOf(stretches_x), MedianOf(stretches_y)};
    expected.stretch_sigma = kLikeStretchSigma;
  }
  return expected;
}

// The outline that its own edge fits best, which is hardly one of a sphere that is partly hidden.
size_t SurestOf(const VerifiedWand& wand, const FittedOutlines& outlines) {
  size_t surest = 0;
  double least = -1;
  for (size_t k = 0; k < outlines.size(); ++k) {
    if (!outlines[k]) continue;
    const double ratio = outlines[k]->edge_chi_squared / std::max(1.0, outlines[k]->edge_freedom) +
                         (wand.centres[k].cut ? kCutRatio : 0);
    if (least < 0 || ratio < least) least = ratio, surest = k;
  }
  return surest;
}

// What the surest outline and the pose say of another one.
ArcExpectation ArcExpectationOf(const VerifiedWand& wand, const FittedOutlines& outlines,
                                size_t marker) {
  ArcExpectation expected;
  const size_t surest = SurestOf(wand, outlines);
  expected.is_cut = wand.centres[marker].cut;
  const SphereOutline& other = *outlines[surest];
  expected.scatter = ScatterOf(other);
  expected.edge_variance_px2 = std::max(0.0, ScatterOfEdges({&other})[0].extra_px2);
  expected.stretch = other.stretch;
  if (wand.px_per_m.size() != outlines.size()) return expected;
  const double own_px_per_m = wand.px_per_m[marker];
  if (surest != marker) {
    expected.radius_px = other.radius_px * own_px_per_m / wand.px_per_m[surest];
    expected.radius_sigma_px = kOtherRadiusPx + kOtherRadiusShare * expected.radius_px;
  } else if (wand.diameter_m > 0) {
    expected.radius_px = 0.5 * wand.diameter_m * own_px_per_m;
    expected.radius_sigma_px = kPoseRadiusPx + kPoseRadiusShare * expected.radius_px;
  }
  return expected;
}

// How much less the edge is on its outline than those of the others, as a ratio of variances.
double EdgeRatio(const FittedOutlines& outlines, size_t marker) {
  double squares = 0, freedom = 0;
  for (size_t k = 0; k < outlines.size(); ++k) {
    if (k == marker || !outlines[k]) continue;
    squares += outlines[k]->edge_chi_squared;
    freedom += outlines[k]->edge_freedom;
  }
  const double others = std::max(kLeastRatio, squares / std::max(1.0, freedom));
  const SphereOutline& own = *outlines[marker];
  return own.edge_chi_squared / std::max(1.0, own.edge_freedom) / others;
}

// How much smaller an outline is than expected, of one whose edge is less on it than the others'.
double MissingRadius(const FittedOutlines& outlines, size_t marker,
                     const OutlineExpectation& expected, double least_ratio) {
  const double missing_px = expected.radius_px - outlines[marker]->radius_px;
  return expected.radius_px > 0 &&
                 missing_px > std::max(kHiddenPx, 1.5 * expected.radius_sigma_px) &&
                 EdgeRatio(outlines, marker) > least_ratio
             ? missing_px
             : 0;
}

// How much longer than the others' an outline is: what hides a side of a sphere makes it so.
double ExtraStretch(const FittedOutlines& outlines, size_t marker) {
  const Eigen::Vector2d& own = outlines[marker]->stretch;
  double extra = own.norm();
  for (size_t k = 0; k < outlines.size(); ++k) {
    if (k == marker || !outlines[k]) continue;
    const Eigen::Vector2d& other = outlines[k]->stretch;
    extra = std::min(extra, own.norm() > other.norm() ? (own - other).norm() : 0);
  }
  return extra;
}

// How far off the place of an outline may be that cannot be quite that of a sphere: one that is
// much smaller than pose and diameter say, or whose light would be less than none on one side.
double WrongOutline(const VerifiedWand& wand, size_t marker, const SphereOutline& outline) {
  double wrong_px = kDarkError * outline.radius_px * std::max(0.0, outline.slope.norm() - 1);
  if (wand.diameter_m > 0 && wand.px_per_m.size() == wand.centres.size()) {
    const double radius_px = 0.5 * wand.diameter_m * wand.px_per_m[marker];
    const double small_px =
        radius_px - outline.radius_px - kPoseRadiusPx - kPoseRadiusShare * radius_px;
    wrong_px = std::hypot(wrong_px, kSmallError * std::max(0.0, small_px));
  }
  return wrong_px;
}

bool IsPartlyHidden(const VerifiedWand& wand, const FittedOutlines& outlines, size_t marker,
                    const OutlineExpectation& expected, const OutlinePixels& pixels) {
  const SphereOutline& own = *outlines[marker];
  // Before a saturated background any sphere looks smaller.
  double saturated = 0;
  for (const uint8_t one : pixels.saturated_behind) saturated += one;
  if (saturated > kMostSaturatedBehind * static_cast<double>(pixels.size())) return false;
  if (MissingRadius(outlines, marker, expected, kHiddenRatio) > 0) return true;
  // More than one may be.
  if (!(wand.diameter_m > 0) || wand.px_per_m.size() != outlines.size()) return false;
  const double radius_px = 0.5 * wand.diameter_m * wand.px_per_m[marker];
  return radius_px - own.radius_px > std::max(kShortPx, 1.5 * expected.radius_sigma_px) &&
         own.edge_chi_squared > kHiddenRatio * std::max(1.0, own.edge_freedom);
}

}  // namespace

void SetOutlinedCentres(const OutlinedMarkers& markers, SphereOutlineFitter* fitter,
                        VerifiedWand* wand) {
  for (size_t k = 0; k < markers.size(); ++k) {
    if (markers[k].outline == nullptr) continue;
    MarkStick(*wand, k, *markers[k].outline, markers[k].pixels);
  }
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
  const double slope_sigma = SlopeSigma(fitted, true), light_sigma = SlopeSigma(fitted, false);
  FittedOutlines outlines(markers.size());
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
  }
  std::vector<VisibleArc> arcs(markers.size());
  const FittedOutlines first = outlines;
  for (size_t k = 0; k < markers.size(); ++k) {
    if (!outlines[k]) continue;
    light.slope_sigma = slope_sigma / std::sqrt(ScatterOf(*outlines[k]));
    arcs[k] = FindVisibleArc(*markers[k].pixels, wand->centres[k].second_moment_px2, light,
                             ArcExpectationOf(*wand, first, k), fitter, &*outlines[k]);
    bool too_little = arcs[k].hidden_count > kNotch && arcs[k].known_count < kLeastKnown;
    // Different things around it, and an edge that is as much on its outline as the others'.
    if ((!arcs[k].stays || too_little) && !wand->centres[k].cut &&
        EdgeRatio(first, k) < kSuspectRatio) {
      arcs[k] = VisibleArc();
      outlines[k] = first[k];
      too_little = false;
    }
    const bool is_arc = wand->centres[k].cut || !arcs[k].is_all();
    if (is_arc && (arcs[k].failed || too_little)) wand->whole[k] = false;
  }
  const bool has_hidden = wand->OccludedCount() > 0;
  bool has_whole = false, has_outline = false;
  for (size_t k = 0; k < markers.size(); ++k) {
    has_outline |= outlines[k].has_value();
    has_whole |= outlines[k] && arcs[k].is_all() && !wand->centres[k].cut;
  }
  const auto pixels_of = [&](size_t k) -> const OutlinePixels& {
    return arcs[k].is_all() ? *markers[k].pixels : arcs[k].pixels;
  };
  const std::vector<EdgeScatter> scatters = ScatterOf(outlines);
  const FittedOutlines arced = outlines;
  OutlinePixels discounted;
  for (size_t k = 0; k < markers.size(); ++k) {
    if (!wand->whole[k]) continue;
    MarkerCentre& centre = wand->centres[k];
    double wrong_px = 0;
    if (outlines[k]) {
      SphereOutline outline = *outlines[k];
      const OutlineExpectation expected = ExpectationOf(*wand, outlines, k);
      light.slope_sigma = slope_sigma / std::sqrt(scatters[k].noise);
      const EdgeScatter& scatter = scatters[k];
      const double odd_px = expected.radius_px > 0 ? outline.radius_px - expected.radius_px : 0;
      if (IsPartlyHidden(*wand, outlines, k, expected, pixels_of(k))) {
        wand->whole[k] = false;
        continue;
      }
      // Not enough to leave it out.
      const double missing_px = MissingRadius(outlines, k, expected, kSuspectRatio);
      OutlineExpectation scaled = expected;
      for (double* sigma :
           {&scaled.radius_sigma_px, &scaled.edge_sigma_px2, &scaled.stretch_sigma}) {
        *sigma /= std::sqrt(scatter.noise);
      }
      const bool is_odd = std::abs(odd_px) > 2 * expected.radius_sigma_px;
      const bool is_arc = centre.cut || !arcs[k].is_all();
      for (int round = 0; round < (is_odd || is_arc ? 2 : 1); ++round) {
        const SectorVariances extra = ExtraVariances(pixels_of(k), outline, scatter, is_arc);
        Discount(pixels_of(k), outline, extra, scatter.noise, &discounted);
        SphereOutline again = outline;
        if (!fitter->Fit(discounted, centre.second_moment_px2, light, &again, scaled)) break;
        fitter->MeasureEdge(pixels_of(k), &again);
        outline = again;
      }
      const double softer_px =
          expected.edge_px2 > 0 ? std::abs(outlines[k]->edge_px - std::sqrt(expected.edge_px2)) : 0;
      wrong_px = std::hypot(
          kOddError * std::max(0.0, std::abs(odd_px) - kOddPx - expected.radius_sigma_px),
          kSofterError * std::max(0.0, softer_px - kSofterPx));
      wrong_px = std::max(wrong_px, missing_px);
      wrong_px = std::hypot(wrong_px, WrongOutline(*wand, k, outline));
      if (markers[k].pixels->clipped) {
        wrong_px = std::hypot(wrong_px, kClippedError * outline.edge_px);
      }
      wrong_px = std::hypot(wrong_px, kMovedError * arcs[k].moved_px);
      wrong_px = std::hypot(wrong_px, kStretchError * outline.radius_px *
                                          std::max(0.0, ExtraStretch(arced, k) - kLikeStretch));
      outlines[k] = outline;
      centre.centre_px = outline.centre_px;
      // Of the sectors' mean, by what the background behind them may be.
      const double background_px2 = std::max(Squared(kBackgroundPx * centre.background_steps),
                                             centre.has_neighbour ? Squared(kNeighbourPx) : 0.0);
      centre.covariance_px2 = scatter.noise / outline.follows * outline.covariance_px2 +
                              kPlacePerEdge * background_px2 * Eigen::Matrix2d::Identity();
    }
    // What is not on an ellipse may be hidden in part, or more than was left out.
    if (outlines[k]) {
      const double usual = centre.cut || !arcs[k].is_all() ? 1 : kSuspectRatio;
      centre.covariance_px2 *= std::max(1.0, EdgeRatio(arced, k) / usual);
    }
    // A radius or a shape that is a little wrong moves the middle of an arc.
    if (outlines[k] && (centre.cut || !arcs[k].is_all())) {
      const Eigen::Vector2d arc_px = kArcError * outlines[k]->radius_px * arcs[k].missing;
      centre.covariance_px2 += arc_px * arc_px.transpose();
      // Without a whole sphere nothing says how large they are.
      if (!has_whole && arcs[k].hidden_count > kNotch) {
        wrong_px = std::hypot(wrong_px, kAloneError * outlines[k]->radius_px);
      }
    }
    // Light from one side is not quite a polynomial, and moves a centroid.
    if (outlines[k]) {
      const double slope = std::min(light_sigma * std::sqrt(2.0), outlines[k]->slope.norm());
      const double blurred_px = slope * outlines[k]->edge_px;
      wrong_px =
          std::hypot(wrong_px, (light.white ? kAcrossWhiteError : kShadingError) * blurred_px);
      if (light.white && slope > 0) {
        const double along_px = (outlines[k]->white ? kWhiteError : kNoWhiteError) * blurred_px;
        const Eigen::Vector2d along = outlines[k]->slope.normalized();
        centre.covariance_px2 += along_px * along_px * along * along.transpose();
      }
    } else {
      wrong_px = kCentroidShadingError * light_sigma * centre.radius_px;
      if (fitted[k]) {
        wrong_px =
            std::hypot(wrong_px, kHiddenError * fitted[k]->off_outline * fitted[k]->radius_px);
      }
      // What hides another marker may hide a part of this one, too; without outlines nothing tells.
      if (has_hidden && !has_outline) {
        wrong_px = std::hypot(wrong_px, kAloneError * centre.radius_px);
      }
    }
    centre.covariance_px2 += wrong_px * wrong_px * Eigen::Matrix2d::Identity();
  }
}

}  // namespace rigcal::agent
