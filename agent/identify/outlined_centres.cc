// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/outlined_centres.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "agent/identify/outline_comparison.h"
#include "agent/identify/outline_sectors.h"
#include "agent/identify/squared.h"
#include "agent/identify/wand_stick.h"

namespace rigcal::agent {
namespace {

// Error of the place in widths of the edge, per relative slope of the light: blur hides how the
// light changes near the rim.
constexpr double kShadingError = 0.05;
// The same along white light, by Lambert's law and by a polynomial in its place; and across it.
constexpr double kWhiteError = 0.006, kNoWhiteError = 0.3, kAcrossWhiteError = 0.004;
constexpr double kCentroidShadingError = 0.25;  // of a centroid: radii, per relative slope
// Error in widths of the edge if the light is clipped, so that its slope is not seen: where it is
// brighter, the edge at half of the clipped light is further out.
constexpr double kClippedError = 0.08;
constexpr double kHiddenError = 0.5;  // of a centroid: radii, per share of the edge off the outline
// Blur joins spheres of a wand that are nearer than kNearGap widths of the edge, and moves them by
// kNearPx along the line between them.
constexpr double kNearGap = 3, kNearPx = 0.05;
// Least EdgeScatter::noise. Spheres with much less noise than the ring have a textured background,
// and half of an edge's pixels is background.
constexpr double kLeastEdgeNoise = 0.55;
constexpr double kPlacePerEdge = 2.0 / kOutlineSectors;  // place's variance over a sector's
constexpr double kBackgroundError = 0.22;                // widths of the edge, per background_steps
constexpr double kNeighbourPx = 0.05;  // one sigma of the edge, if something else is near
constexpr double kCutError = 0.045;    // radii, of an outline that the border cuts
constexpr double kAloneError = 0.2;    // radii, if a marker is hidden and none has an outline
constexpr double kMostSigmaPx = 0.5;   // centres that are less well known are not delivered
// Error of the place per px by which the radius (odd) or the edge (softer) exceeds its tolerance.
constexpr double kOddPx = 0.04, kOddError = 0.6;
constexpr double kSofterPx = 0.1, kSofterError = 0.4;
// Share of the slopes' variance by noise that is added, over the root of their number.
constexpr double kUnknownSlope = 0.5;
constexpr double kLeastSlope = 0.005;  // least SlopeSigma
constexpr double kEvenLight = 4;       // slope_chi_squared, up to which the light is even
constexpr double kWhiteGain = 4;       // half a chi-squared, by which white light must fit better

// One sigma of the relative slopes of the light on the wand's spheres; `own`: of their own light.
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

// Returns the outlines with the kind of light, the same for all spheres, that fits better.
FittedOutlines WithTheirLight(const OutlinedMarkers& markers, const VerifiedWand& wand,
                              bool may_be_white, SphereOutlineFitter* fitter,
                              SphereShading* light) {
  FittedOutlines own(markers.size()), white(markers.size());
  double gained = 0;
  for (size_t k = 0; k < markers.size(); ++k) {
    if (markers[k].outline == nullptr) continue;
    own[k] = white[k] = *markers[k].outline;
    // Even light, as in a dark room, needs no other model.
    if (!may_be_white || own[k]->slope_chi_squared < kEvenLight * ScatterOf(*own[k])) continue;
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

// Sets a wand's centres, step by step.
class OutlinedCentres {
 public:
  OutlinedCentres(const OutlinedMarkers& markers, SphereOutlineFitter* fitter, VerifiedWand* wand,
                  const WandMechanisms& without)
      : without_(without),
        markers_(markers),
        fitter_(*fitter),
        wand_(*wand),
        outlines_(markers.size()) {}

  void Set() {
    for (size_t k = 0; k < markers_.size(); ++k) {
      if (markers_[k].outline != nullptr) {
        MarkStick(wand_, k, *markers_[k].outline, markers_[k].pixels);
      }
    }
    fitted_ = WithTheirLight(markers_, wand_, !without_.Has(WandMechanism::kLambertShading),
                             &fitter_, &light_);
    slope_sigma_ = SlopeSigma(fitted_, true);
    light_sigma_ = SlopeSigma(fitted_, false);
    FitOutlines();
    scatters_ = ScatterOf(outlines_);
    first_ = outlines_;
    has_hidden_ = wand_.OccludedCount() > 0;
    has_outline_ =
        std::ranges::any_of(outlines_, [](const auto& outline) { return outline.has_value(); });
    for (size_t k = 0; k < markers_.size(); ++k) {
      if (!wand_.whole[k]) continue;
      if (outlines_[k]) {
        SetByOutline(k);
      } else {
        WidenCentroid(k);
      }
    }
  }

 private:
  // Returns light whose prior keeps its weight when `scatter` scales the noise.
  SphereShading LightOver(double scatter) const {
    SphereShading light = light_;
    light.slope_sigma = slope_sigma_ / std::sqrt(scatter);
    return light;
  }

  void FitOutlines() {
    for (size_t k = 0; k < markers_.size(); ++k) {
      if (!fitted_[k]) continue;
      SphereOutline outline = *fitted_[k];
      if (!outline.white && !fitter_.Fit(*markers_[k].pixels, wand_.centres[k].second_moment_px2,
                                         LightOver(ScatterOf(outline)), &outline)) {
        outline = *fitted_[k];
      }
      outlines_[k] = outline;
    }
  }

  void SetByOutline(size_t k) {
    MarkerCentre& centre = wand_.centres[k];
    OutlineExpectation expected = ExpectationOf(wand_, outlines_, k);
    if (without_.Has(WandMechanism::kOtherSpheres)) expected = {};
    if (IsPartlyHidden(wand_, outlines_, k, expected, *markers_[k].pixels)) {
      wand_.whole[k] = false;
      return;
    }
    // Too little to leave it out, but an error all the same.
    const double missing_px = MissingRadius(outlines_, k, expected);
    const double odd_px = expected.radius_px > 0 ? outlines_[k]->radius_px - expected.radius_px : 0;
    const double softer_px =
        expected.edge_px2 > 0 ? std::abs(outlines_[k]->edge_px - std::sqrt(expected.edge_px2)) : 0;
    outlines_[k] = FittedAgain(k, expected, std::abs(odd_px) > 2 * expected.radius_sigma_px);
    const SphereOutline& outline = *outlines_[k];
    double wrong_px =
        std::hypot(kOddError * std::max(0.0, std::abs(odd_px) - kOddPx - expected.radius_sigma_px),
                   kSofterError * std::max(0.0, softer_px - kSofterPx));
    wrong_px = std::max(wrong_px, missing_px);
    wrong_px = std::hypot(wrong_px, WrongOutline(wand_, k, outline));
    wrong_px = std::hypot(wrong_px, WrongByStretch(first_, k));
    if (markers_[k].pixels->clipped) {
      wrong_px = std::hypot(wrong_px, kClippedError * outline.edge_px);
    }
    centre.centre_px = outline.centre_px;
    // Variance of a sector's edge, px^2, because of an uneven background or something else near.
    const double background_px2 =
        std::max(Squared(kBackgroundError * outline.edge_px * centre.background_steps),
                 centre.has_neighbour ? Squared(kNeighbourPx) : 0.0);
    const double noise = std::max(scatters_[k].noise, kLeastEdgeNoise);
    centre.covariance_px2 = noise / outline.follows * outline.covariance_px2 +
                            kPlacePerEdge * background_px2 * Eigen::Matrix2d::Identity();
    // An edge that scatters about its ellipse may be hidden in part, or more than was left out.
    centre.covariance_px2 *= std::max(1.0, EdgeRatio(first_, k) / (centre.cut ? 1 : kSuspectRatio));
    // A slightly wrong radius or shape moves the middle of what the border leaves.
    if (centre.cut) wrong_px = std::hypot(wrong_px, kCutError * outline.radius_px);
    WidenByNear(k, outline.edge_px);
    wrong_px = std::hypot(wrong_px, WidenByLight(outline, &centre));
    centre.covariance_px2 += wrong_px * wrong_px * Eigen::Matrix2d::Identity();
    const double sigma_px = std::sqrt(0.5 * centre.covariance_px2.trace());
    if (sigma_px > kMostSigmaPx) wand_.whole[k] = false;
  }

  // Fits again, with what the other spheres say, and sectors weighted by how near their edges are.
  SphereOutline FittedAgain(size_t k, const OutlineExpectation& expected, bool is_odd) {
    const EdgeScatter& scatter = scatters_[k];
    OutlineExpectation scaled = expected;
    for (double* sigma : {&scaled.radius_sigma_px, &scaled.edge_sigma_px2, &scaled.stretch_sigma}) {
      *sigma /= std::sqrt(scatter.noise);
    }
    SphereOutline outline = *outlines_[k];
    for (int round = 0; round < (is_odd || wand_.centres[k].cut ? 2 : 1); ++round) {
      const SectorVariances extra =
          ExtraVariances(*markers_[k].pixels, outline, scatter, wand_.centres[k].cut);
      Discount(*markers_[k].pixels, outline, extra, scatter.noise, &discounted_);
      SphereOutline again = outline;
      if (!fitter_.Fit(discounted_, wand_.centres[k].second_moment_px2, LightOver(scatter.noise),
                       &again, scaled)) {
        break;
      }
      fitter_.MeasureEdge(*markers_[k].pixels, &again);
      outline = again;
    }
    return outline;
  }

  void WidenByNear(size_t k, double edge_px) {
    MarkerCentre& own = wand_.centres[k];
    for (size_t j = 0; j < wand_.centres.size(); ++j) {
      const MarkerCentre& other = wand_.centres[j];
      const Eigen::Vector2d way_px = other.centre_px - own.centre_px;
      const double gap_px = way_px.norm() - own.radius_px - other.radius_px;
      if (j == k || gap_px > kNearGap * edge_px) continue;
      own.covariance_px2 += Squared(kNearPx) * way_px * way_px.transpose() / way_px.squaredNorm();
      // The outlines of spheres that overlap cannot be told apart.
      if (gap_px < 0) wand_.whole[k] = false;
    }
  }

  // Light from one side is not quite a polynomial. Widens the covariance along white light, and
  // returns one sigma of the error in every direction, px.
  double WidenByLight(const SphereOutline& outline, MarkerCentre* centre) const {
    const double slope = std::min(light_sigma_ * std::sqrt(2.0), outline.slope.norm());
    const double blurred_px = slope * outline.edge_px;
    if (!light_.white) return kShadingError * blurred_px;
    if (slope > 0) {
      const double along_px = (outline.white ? kWhiteError : kNoWhiteError) * blurred_px;
      const Eigen::Vector2d along = outline.slope.normalized();
      centre->covariance_px2 += along_px * along_px * along * along.transpose();
    }
    return kAcrossWhiteError * blurred_px;
  }

  // Light from one side and what hides a part of a sphere move a centroid.
  void WidenCentroid(size_t k) {
    MarkerCentre& centre = wand_.centres[k];
    double wrong_px = kCentroidShadingError * light_sigma_ * centre.radius_px;
    if (fitted_[k]) {
      wrong_px =
          std::hypot(wrong_px, kHiddenError * fitted_[k]->off_outline * fitted_[k]->radius_px);
    }
    // What hides another marker may hide a part of this one too; without outlines nothing shows it.
    if (has_hidden_ && !has_outline_) {
      wrong_px = std::hypot(wrong_px, kAloneError * centre.radius_px);
    }
    centre.covariance_px2 += wrong_px * wrong_px * Eigen::Matrix2d::Identity();
  }

  WandMechanisms without_;
  const OutlinedMarkers& markers_;
  SphereOutlineFitter& fitter_;
  VerifiedWand& wand_;
  SphereShading light_;
  double slope_sigma_ = 0, light_sigma_ = 0;
  // Outlines with any slope of the light; with its prior and in later fits; before the last fit.
  FittedOutlines fitted_, outlines_, first_;
  std::vector<EdgeScatter> scatters_;
  bool has_hidden_ = false, has_outline_ = false;
  OutlinePixels discounted_;
};

}  // namespace

void SetOutlinedCentres(const OutlinedMarkers& markers, SphereOutlineFitter* fitter,
                        VerifiedWand* wand, const WandMechanisms& without) {
  OutlinedCentres(markers, fitter, wand, without).Set();
}

}  // namespace rigcal::agent
