// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_score.h"

#include <algorithm>
#include <cmath>

namespace rigcal::agent {
namespace {

struct NamedWeight {
  WandFeature feature;
  WandWeight weight;
};

#include "agent/identify/wand_score_weights.inc"

// A table that was fitted to other features does not compile.
constexpr bool BelongsToTheFeatures() {
  for (size_t i = 0; i < std::size(kWeights); ++i) {
    if (static_cast<size_t>(kWeights[i].feature) != i) return false;
  }
  return std::size(kWeights) == kWandFeatureCount;
}
static_assert(BelongsToTheFeatures(), "run rigcal-accuracy fit_wand_score");

}  // namespace

const WandWeight& WeightOf(WandFeature feature) {
  return kWeights[static_cast<size_t>(feature)].weight;
}

double MostLogOdds(bool is_lit) { return is_lit ? kBiasLit : kBiasDark; }

double WandCost(const WandFeatures& features, WandFeature feature, bool is_lit) {
  const WandWeight& weight = WeightOf(feature);
  return (is_lit ? weight.lit : weight.dark) * std::min(features[feature], weight.most);
}

double WandLogOdds(const WandFeatures& features, bool is_lit) {
  double log_odds = MostLogOdds(is_lit);
  for (const NamedWeight& named : kWeights) log_odds -= WandCost(features, named.feature, is_lit);
  return log_odds;
}

double ConfidenceOf(double log_odds) { return 1 / (1 + std::exp(-log_odds)); }

}  // namespace rigcal::agent
