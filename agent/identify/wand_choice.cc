// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_choice.h"

#include <algorithm>
#include <cmath>

#include "agent/identify/partial_evidence.h"

namespace rigcal::agent {
namespace {

constexpr double kMargin = 8;  // in cost, of a wand against the next best
// The same two spheres the other way round are hardly ever nearer than that, and never better.
constexpr double kFlippedMargin = 2.2;
constexpr double kBrighter = 1.25;  // than its reflection
constexpr double kCertain = 0.999;
constexpr double kOccludedOdds = 2.5;  // of a wand with a marker that is not whole, to others'

// By all that is known of it: something else of little cost has evidence against it.
double CostOfAll(const VerifiedWand& wand) { return wand.cost - wand.evidence; }

// The wand's labels are as certain as others for the same spheres are worse.
void SetLabelConfidence(double min_confidence, const std::vector<VerifiedWand>& wands,
                        VerifiedWand* wand) {
  for (const VerifiedWand& other : wands) {
    const bool is_flipped = other.confidence >= min_confidence && SameWholeBlobs(*wand, other) &&
                            !SameWholes(*wand, other);
    if (&other == wand || !(is_flipped || SameBlobs(wand->blobs, other.blobs))) continue;
    const double other_cost = is_flipped ? FlippedCost(*wand, other) : other.cost;
    const double certainty = 1 / (1 + std::exp(0.5 * (wand->cost - other_cost)));
    wand->label_confidence = std::min(wand->label_confidence, certainty);
  }
  wand->label_confidence = std::clamp(wand->label_confidence, 0.5, kCertain);
  if (wand->blobs.size() == 1) wand->label_confidence = 1;
}

}  // namespace

bool IsConfident(const VerifiedWand& wand, double min_confidence) {
  const double least = wand.OccludedCount() > 0 ? kOccludedOdds * min_confidence : min_confidence;
  // least odds * (1 - c) <= c, with odds that may be infinite.
  return wand.confidence * (1 - min_confidence) >= least * (1 - wand.confidence);
}

Verdict ChooseWand(double min_confidence, std::vector<VerifiedWand>* wands) {
  Verdict verdict;
  std::stable_sort(wands->begin(), wands->end(),
                   [](const VerifiedWand& a, const VerifiedWand& b) { return a.cost < b.cost; });
  const VerifiedWand* likeliest = nullptr;
  for (const VerifiedWand& wand : *wands) {
    if (!IsConfident(wand, min_confidence)) continue;
    if (likeliest == nullptr || CostOfAll(wand) < CostOfAll(*likeliest)) likeliest = &wand;
  }
  if (likeliest == nullptr) return verdict;
  const auto may_be_it = [&](const VerifiedWand& wand) {
    return IsConfident(wand, min_confidence) &&
           (CostOfAll(wand) <= CostOfAll(*likeliest) + kMargin || !Disjoint(wand, *likeliest));
  };
  VerifiedWand* best = nullptr;
  for (VerifiedWand& other : *wands) {
    if (!may_be_it(other)) continue;
    if (best == nullptr) {
      best = &other;
      continue;
    }
    const VerifiedWand& now = *best;
    if (SameBlobs(now.blobs, other.blobs) || SameWholes(now, other) || SamePlaces(now, other) ||
        IsPartOf(other, now)) {
      continue;
    }
    // The same two spheres the other way round; the labels have a confidence of their own.
    const bool is_flipped = SameWholeBlobs(now, other);
    if (!is_flipped && CostOfAll(other) > CostOfAll(now) + kMargin) continue;
    if (Disjoint(now, other)) {
      const double ratio = MeanBrightness(other) / MeanBrightness(now);
      if (ratio > kBrighter) best = &other;
      if (ratio > kBrighter || ratio < 1 / kBrighter) continue;
    } else if (other.OccludedCount() > now.OccludedCount()) {
      continue;  // a part of the wand with something else beside it
    }
    verdict.ambiguous |= is_flipped ? FlippedCost(now, other) < now.cost + kFlippedMargin
                                    : other.cost < now.cost + kMargin;
  }
  if (verdict.ambiguous) return verdict;
  SetLabelConfidence(min_confidence, *wands, best);
  verdict.wand = *best;
  return verdict;
}

}  // namespace rigcal::agent
