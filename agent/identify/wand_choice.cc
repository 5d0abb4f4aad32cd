// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_choice.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "agent/identify/wand_finder.h"

namespace rigcal::agent {
namespace {

constexpr double kMargin = 3.2;     // log-odds by which a wand leads the next best
constexpr double kBrighter = 1.25;  // times as bright as its reflection a wand must be
constexpr double kCertain = 0.999;  // limit of the label confidence

// Computes the likelihood ratio of the wand's labels against the others for the same spheres: these
// differ only in the pose, whose cost is a chi-squared.
void SetLabelConfidence(const std::vector<VerifiedWand>& wands, VerifiedWand* wand) {
  for (const VerifiedWand& other : wands) {
    if (&other == wand || !SameBlobs(wand->blobs, other.blobs)) continue;
    const double certainty = 1 / (1 + std::exp(0.5 * (wand->fit.cost - other.fit.cost)));
    wand->label_confidence = std::min(wand->label_confidence, certainty);
  }
  wand->label_confidence = std::clamp(wand->label_confidence, 0.5, kCertain);
  if (wand->blobs.size() == 1) wand->label_confidence = 1;
}

}  // namespace

Verdict ChooseWand(double min_confidence, std::vector<VerifiedWand>* wands) {
  Verdict verdict;
  std::ranges::stable_sort(*wands, std::ranges::greater(), &VerifiedWand::log_odds);
  VerifiedWand* best = nullptr;
  for (VerifiedWand& other : *wands) {
    if (other.confidence < min_confidence) break;
    if (best == nullptr) {
      best = &other;
      continue;
    }
    if (other.log_odds < best->log_odds - kMargin) break;
    if (SameBlobs(best->blobs, other.blobs) || SamePlaces(*best, other)) continue;
    if (Disjoint(*best, other)) {
      const double ratio = MeanBrightness(other) / MeanBrightness(*best);
      if (ratio > kBrighter) best = &other;
      if (ratio > kBrighter || ratio < 1 / kBrighter) continue;
    }
    verdict.ambiguous = true;
  }
  if (best == nullptr || verdict.ambiguous) return verdict;
  SetLabelConfidence(*wands, best);
  verdict.wand = *best;
  return verdict;
}

}  // namespace rigcal::agent
