// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_features.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

constexpr double kLeastCosine = 0.01;     // least cosine of a tilt
constexpr double kSkewnessScale = 0.012;  // skewness of a sphere of which a sixtieth is hidden
constexpr double kMostLopsided = 7.5;     // limit for one marker
constexpr double kLargeRadiusPx = 5.5;    // nothing else looks like a sphere of this size
// Misfit of a usual sphere; the most that noise explains; and the most that kRough counts.
constexpr double kUsualMisfit = 0.5, kNoisyMisfit = 1, kMostRough = 0.5;
constexpr double kMeterNoise = 0.015;   // one sigma of a coverage, kModelNoise of MarkerMeter
constexpr double kOutlineNoise = 0.03;  // the same, with what the model of an outline leaves
// A round outline has so many sectors on it and so few off it. Its misfit is limited, because the
// stick or its shadow may take a piece of the sphere.
constexpr double kMostlyOnOutline = 0.75, kHardlyOffOutline = 0.1, kMostRoundMisfit = 0.4;
// One sigma of a stretch: share plus px / radius; and the largest mean stretch by motion.
constexpr double kStretchSigma = 0.03, kStretchSigmaPx = 0.25, kUsualStretch = 0.15;

// Returns the residual of an outline's fit over what noise and shading may leave.
double Misfit(const MarkerCentre& centre, const SphereOutline& outline) {
  const double noise = centre.noise_grey / centre.contrast_grey;
  return outline.residual * std::hypot(noise, kMeterNoise) / std::hypot(noise, kOutlineNoise);
}

double Lopsided(const MarkerCentre& centre) {
  const double excess = std::max(0.0, centre.skewness - 2 * centre.skewness_sigma);
  return std::min(Squared(excess / kSkewnessScale), kMostLopsided);
}

}  // namespace

void MeasureLikeness(VerifiedWand* wand) {
  WandFeatures& features = wand->features;
  const auto count = static_cast<double>(wand->centres.size());
  double mean = 0;
  Eigen::Vector3d colour = Eigen::Vector3d::Zero();
  for (const MarkerCentre& centre : wand->centres) {
    mean += std::log(centre.plateau_grey.norm()) / count;
    colour += centre.plateau_grey.normalized();
  }
  colour.normalize();
  features[WandFeature::kBrightness] = features[WandFeature::kColour] = 0;
  for (const MarkerCentre& centre : wand->centres) {
    features[WandFeature::kBrightness] += Squared(std::log(centre.plateau_grey.norm()) - mean);
    features[WandFeature::kColour] += (centre.plateau_grey.normalized() - colour).squaredNorm();
  }
  features[WandFeature::kPose] = wand->fit.cost;
  features[WandFeature::kTilt] = -std::log(std::max(kLeastCosine, std::cos(wand->fit.tilt_rad)));
  features[WandFeature::kWhite] = IsWhite(*wand) ? 1 : 0;
}

void MeasureShapes(const absl::InlinedVector<const SphereOutline*, 3>& outlines,
                   VerifiedWand* wand) {
  WandFeatures& features = wand->features;
  for (const WandFeature shape :
       {WandFeature::kLopsided, WandFeature::kNoOutline, WandFeature::kNoLargeOutline,
        WandFeature::kMisfit, WandFeature::kRough, WandFeature::kOffOutline,
        WandFeature::kUnequalShape}) {
    features[shape] = 0;
  }
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double weights = 0;
  absl::InlinedVector<std::pair<Eigen::Vector2d, double>, 3> stretches;
  for (size_t k = 0; k < outlines.size(); ++k) {
    const MarkerCentre& centre = wand->centres[k];
    const bool is_large = centre.radius_px > kLargeRadiusPx;
    if (outlines[k] == nullptr) {
      features[is_large ? WandFeature::kNoLargeOutline : WandFeature::kNoOutline] += 1;
      features[WandFeature::kLopsided] += Lopsided(centre);
      continue;
    }
    const SphereOutline& outline = *outlines[k];
    const double misfit = Misfit(centre, outline);
    const double excess = Squared(std::max(0.0, misfit - kNoisyMisfit));
    // The stick takes a piece out of the image, which is then lopsided, but leaves the outline.
    const bool is_round =
        outline.on_outline > kMostlyOnOutline && outline.off_outline < kHardlyOffOutline;
    features[WandFeature::kMisfit] += is_round ? std::min(excess, kMostRoundMisfit) : excess;
    if (!is_round) features[WandFeature::kLopsided] += Lopsided(centre);
    // Large things are seldom round, and dim spheres fit no better, because of their noise.
    if (!is_large) {
      features[WandFeature::kRough] += std::clamp(misfit - kUsualMisfit, 0.0, kMostRough);
    }
    features[WandFeature::kOffOutline] += Squared(outline.off_outline);
    const double weight = 1 / Squared(kStretchSigma + kStretchSigmaPx / outline.radius_px);
    stretches.emplace_back(outline.stretch, weight);
    mean += weight * outline.stretch;
    weights += weight;
  }
  if (weights > 0) mean /= weights;
  features[WandFeature::kBlurred] = Squared(std::max(0.0, mean.norm() - kUsualStretch));
  // Motion stretches all spheres alike.
  for (const auto& [stretch, weight] : stretches) {
    features[WandFeature::kUnequalShape] += weight * (stretch - mean).squaredNorm();
  }
}

}  // namespace rigcal::agent
