// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "agent/detect/frame/wand_detector.h"

namespace rigcal::agent {

// For people: the outcome, the most likely candidates with what each feature costs, and why the
// others were not scored; without a candidate what is there instead. `min_confidence`: of the
// detector.
std::string FormatExplanation(const std::string& name, const WandExplanation& explanation,
                              const Target& target, double min_confidence);
// The same as one JSON object, a contract: picture, outcome, confidence, blobs, cut_short,
// candidates[{markers_px, log_odds, confidence, lit, features{name: {value, cost}}}],
// refused[{reason, count, markers_px}], why. `why`: what speaks against a wand as told; may be "".
std::string ExplanationJson(const std::string& name, const WandExplanation& explanation,
                            const Target& target);

}  // namespace rigcal::agent
