// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// The rule by which an observation's labels are counted from the wrong end of the target:
//   an order of its labels scores, over its markers, the sum of min(1, (|r| / limit)^2), with r the
//   whitened residual and `limit` the one beyond which a marker of its camera is an outlier;
//   it is flipped when the other order scores better by more than 0.5.
// So a wand seen from its end, which fits either way, stays as it is. Where too few cameras see an
// instant for the others to say which of them is wrong, the target is placed anew with each
// observation flipped in its turn; the best is taken if it explains every marker and the next best
// does not fit nearly as well. An instant that points against its neighbours on both sides is
// flipped as a whole where that fits as well: two ends alone look the same both ways. A single
// marker with another's label is an outlier.
// A rigid target has no other end: none is flipped.
//
// Indices of the observations to turn, ascending; `instant_time_ns` as of BuiltProblem. Does not
// change the problem. Instants that are not used are looked at too where they have few
// observations.
std::vector<int> FindFlippedLabels(const BundleProblem& problem,
                                   const std::vector<int64_t>& instant_time_ns);

// Counts the labels of an observation from the other end and lets all its markers take part again.
// Their order in the problem stays.
void FlipLabels(int observation, BundleProblem* problem);

}  // namespace rigcal::server
