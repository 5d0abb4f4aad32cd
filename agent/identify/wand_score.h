// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rigcal::agent {

// Features of a candidate. Each is 0 for a perfect wand and grows with the doubt.
enum class WandFeature : uint8_t {
  kPose,            // chi-squared of the pose that explains places and radii best
  kBrightness,      // squared deviations of the logarithms of the markers' brightness, summed
  kColour,          // squared angles of the markers' colours to their mean, rad^2, summed
  kTilt,            // minus the logarithm of the cosine of the tilt
  kWhite,           // 1 if all markers are white
  kLopsided,        // squared skewness beyond noise, of markers without a round outline
  kNoOutline,       // markers to which no outline can be fitted
  kNoLargeOutline,  // the same for large markers, for which a notch by the stick is enough
  kMisfit,          // squared residuals of the outlines beyond noise, summed
  kRough,           // residuals of the outlines of small markers beyond the usual ones, summed
  kOffOutline,      // squared shares of the sectors that are off the outline, summed
  kUnequalShape,    // chi-squared of the outlines' shapes against one another
  kBlurred,         // squared mean stretch of the outlines beyond the usual one by motion
};
inline constexpr size_t kWandFeatureCount = 13;

class WandFeatures {
 public:
  double& operator[](WandFeature feature) { return values_[static_cast<size_t>(feature)]; }
  double operator[](WandFeature feature) const { return values_[static_cast<size_t>(feature)]; }

 private:
  std::array<double, kWandFeatureCount> values_{};
};

// How the score uses a feature.
struct WandWeight {
  const char* name;  // "pose"
  double most;       // larger values count as this
  // Log-odds that one unit of the feature costs, in a dark room and in a lit one.
  double dark, lit;
};
const WandWeight& WeightOf(WandFeature feature);

// Returns the natural logarithm of the odds that a candidate is a wand: the bias of the room's
// light minus each feature's weight times the feature. `rigcal-accuracy fit_wand_score` fits the
// weights of this logistic model to rendered rooms (wand_score_weights.inc).
double WandLogOdds(const WandFeatures& features, bool is_lit);
// Returns what a feature takes off the log-odds.
double WandCost(const WandFeatures& features, WandFeature feature, bool is_lit);
// Returns the largest log-odds that a candidate can have.
double MostLogOdds(bool is_lit);

// Returns a probability, 0 to 1.
double ConfidenceOf(double log_odds);

}  // namespace rigcal::agent
