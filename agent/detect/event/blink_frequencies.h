// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/target/target.h"

namespace rigcal::agent {

// What a target's markers blink at: the frequencies to tell apart, ascending, and which of them
// each marker has.
struct BlinkFrequencies {
  std::vector<double> hz;
  std::vector<int> of_marker;
};

// Frequencies up to this ratio apart count as one, their mean: oscillators that should be equal.
inline constexpr double kSameBlinkRatio = 1.02;

// The target must be valid; `default_hz` is that of one that tells none.
BlinkFrequencies BlinkFrequenciesOf(const Target& target, double default_hz);

}  // namespace rigcal::agent
