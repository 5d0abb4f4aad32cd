// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rigcal::agent {

// What is measured of a candidate. Each feature is 0 for a perfect wand and grows with the doubt.
enum class WandFeature : uint8_t {
  kPose,            // chi-squared of the pose that explains places and radii best
  kBrightness,      // squared deviations of the logarithms of the markers' brightness, summed
  kColour,          // squared angles of the markers' colours to their mean, rad^2, summed
  kTilt,            // minus the logarithm of the cosine of the tilt out of the image plane
  kWhite,           // 1: no marker has a colour
  kLopsided,        // squared skewness beyond noise, of markers without a round outline
  kNoOutline,       // markers to which no outline can be fitted
  kNoLargeOutline,  // the same of large ones, which a notch by the stick is enough for
  kMisfit,          // squared residuals of the outlines beyond noise, summed
  kRough,           // residuals of the outlines of small markers beyond the usual ones, summed
  kOffOutline,      // squared shares of an edge that are off its outline, summed
  kUnequalShape,    // chi-squared of the outlines' shapes against one another
  kBlurred,         // squared stretch of all outlines beyond the usual one by motion
};
inline constexpr size_t kWandFeatureCount = 13;

class WandFeatures {
 public:
  double& operator[](WandFeature feature) { return values_[static_cast<size_t>(feature)]; }
  double operator[](WandFeature feature) const { return values_[static_cast<size_t>(feature)]; }

 private:
  std::array<double, kWandFeatureCount> values_{};
};

// A feature as the score uses it.
struct WandWeight {
  const char* name;  // "pose"
  double most;       // what is larger counts as this
  // Log-odds that one unit of the feature costs, in a dark room and in a lit one.
  double dark, lit;
};
const WandWeight& WeightOf(WandFeature feature);

// Natural logarithm of the odds that a candidate with these features is a wand: the bias of the
// room's light minus each feature's weight times the feature, a logistic model whose weights
// `rigcal-accuracy fit_wand_score` fits to rendered rooms (wand_score_weights.inc).
double WandLogOdds(const WandFeatures& features, bool is_lit);
// What a feature takes off it.
double WandCost(const WandFeatures& features, WandFeature feature, bool is_lit);
// The most that any candidate can have.
double MostLogOdds(bool is_lit);

// 0 to 1.
double ConfidenceOf(double log_odds);

}  // namespace rigcal::agent
