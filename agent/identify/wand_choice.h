// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

struct Verdict {
  std::optional<VerifiedWand> wand;
  bool ambiguous = false;  // a rival scores as well, so no wand is returned
  size_t measured = 0;     // candidates, from the first one on
  bool left_out = false;   // not all were measured for lack of work
};

// Sorts the wands of one image by their log-odds and chooses the most likely one, if it is
// confident enough and nothing else is nearly as likely. The same wand the other way round is no
// rival. Of two equally good wands without a common blob the brighter one is taken: the other is
// its reflection in a floor or a window. Sets the confidence of the labels.
Verdict ChooseWand(double min_confidence, std::vector<VerifiedWand>* wands);

}  // namespace rigcal::agent
