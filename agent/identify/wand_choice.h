// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

struct Verdict {
  std::optional<VerifiedWand> wand;
  bool ambiguous = false;  // another one is as good; then `wand` is none
  size_t measured = 0;     // of the candidates from the first one on
  bool left_out = false;   // what was not measured was too much work, and not clearly worse
};

// Whether a wand's confidence is enough. With a marker that is not whole more is needed: another
// look may show all of it.
bool IsConfident(const VerifiedWand& wand, double min_confidence);

// Chooses among the wands of one image, which it sorts by their cost: of those that are confident
// enough the one of least cost, if nothing else is nearly as good. The same wand the other way
// round is by its cost; anything else, only if the evidence does not tell them apart either. Of two
// wands without a common blob that are equally good the brighter one is taken: the other is its
// reflection in a floor or a window. Sets the confidence of the labels.
Verdict ChooseWand(double min_confidence, std::vector<VerifiedWand>* wands);

}  // namespace rigcal::agent
